"""docs/equations.md is what the generator writes, complete and true; and the generator sees what it must see."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from flexmb.frisch.errata import Erratum
from tests.repo.citations import Sources, numbers, texts
from tests.repo.equations import PAGE, Equation, Index, Paper, anchor, errata_of, headings, numbers_in, page, papers
from tests.repo.project import ROOT

SOURCES = Sources(
    folders=("flexmb/frisch", "tests/flexmb/frisch"), names=("Frisch",), other_names=("Jain & Rodriguez", "Jain")
)
CODE, TEST = Path("flexmb/frisch/mass.py"), Path("tests/flexmb/frisch/test_mass.py")
Write = Callable[[Path, str], None]


@pytest.fixture(scope="module")
def indices() -> list[Index]:
    return [Index.of(paper) for paper in papers()]


def test_the_page_is_what_the_generator_writes(indices: list[Index]) -> None:
    assert PAGE.read_text(encoding="utf-8") == page(indices), "run `python -m tests.repo.equations`"


def test_every_equation_has_code_and_test_or_a_reason(indices: list[Index]) -> None:
    assert indices
    faults = [fault for index in indices for fault in index.faults()]
    assert not faults, "\n".join(faults)


def test_errata_name_tests_and_equations_that_exist(indices: list[Index]) -> None:
    """`path.py::test_name` on a page of errata is a test; its headings name equations of the paper."""
    for index in indices:
        text = errata_of(index.paper)
        for path, name in re.findall(r"`([\w/]+\.py)::(\w+)`", text):
            assert name in texts((ROOT / path).read_text(encoding="utf-8")), f"{path} has no {name}"
        known = {equation.number for equation in index.paper.equations}
        assert all(set(numbers_in(heading)) <= known for heading in headings(text))


def test_links_within_errata(indices: list[Index]) -> None:
    for page_of_errata in {index.paper.errata for index in indices}:
        text = (ROOT / "docs" / page_of_errata).read_text(encoding="utf-8")
        assert set(re.findall(r"\]\(#([\w-]+)\)", text)) <= {anchor(heading) for heading in headings(text)}


def test_every_switch_of_the_print_is_explained(indices: list[Index]) -> None:
    """Each member of Erratum is in the table of the page, in a row that names its equations."""
    (frisch,) = (index for index in indices if "Frisch" in index.paper.sources.names)
    rows = [line for line in errata_of(frisch.paper).splitlines() if line.startswith("| [(")]
    for erratum in Erratum:
        (row,) = (row for row in rows if f"`{erratum.name}`" in row)
        assert set(numbers_in(erratum.value)) <= set(numbers_in(row)), row


@pytest.mark.parametrize(
    ("text", "in_folder", "elsewhere"),
    [
        ("G of (98)", [98], []),
        ("Rows (129)-(131), (136).", [129, 130, 131, 136], []),
        ("from (43) to\n(45)", [43, 44, 45], []),
        ("The print's Frisch (48) and (50)-(52); see (70)", [48, 50, 51, 52, 70], [48, 50, 51, 52]),
        ("Frisch's (12), beside (13) of another", [12, 13], [12]),
        ("Jain &\nRodriguez (44), (45), but Frisch (107)", [107], [107]),
        ("shapes (3,), (n, 3), f(4), theta(5)(6), NASA (1975)", [], []),
        ("Frischs (7), frisch (8)", [7, 8], []),
    ],
)
def test_numbers(text: str, in_folder: list[int], elsewhere: list[int]) -> None:
    assert list(numbers(text, SOURCES, in_folder=True)) == list(map(str, in_folder))
    assert list(numbers(text, SOURCES, in_folder=False)) == list(map(str, elsewhere))


def test_numbers_named_by_themselves() -> None:
    assert numbers("(1)-(3), (2); (4), (4) to (5)", SOURCES, in_folder=True) == {
        "1": False, "2": True, "3": False, "4": True, "5": False,
    }  # fmt: skip


def test_numbers_of_appendices() -> None:
    lettered = Sources(("flexmb/jain",), ("Jain",), ("Frisch",), letters=("A", "B"))
    text = "(64), (A1)-(A3), (B3) of a matrix (M1), Frisch (A9); f(B2)"
    assert list(numbers(text, lettered, in_folder=True)) == ["64", "A1", "A2", "A3", "B3"]
    assert list(numbers("Jain (64), (B3); see (B4)", lettered, in_folder=False)) == ["64", "B3"]
    assert list(numbers(text, SOURCES, in_folder=True)) == ["64"]
    assert list(numbers("of (48), Jain (B3) and (12), (M1)", SOURCES, in_folder=True)) == ["48"]


SOURCE = '''"""M"""
# m
class A:
    """A"""
    x = 1  # a
    def f(self):
        """F"""
        if 1:
            def g():
                """G"""
                "#" # g
        return 1  # f
'''


def test_texts_of_methods_and_nested_functions() -> None:
    assert texts(SOURCE) == {"": "M\nm", "A": "A\na", "A.f": "F\nf", "A.f.g": "G\ng"}


def test_anchor() -> None:
    assert anchor("(52), (12): E_n of `points` that turn") == "52-12-e_n-of-points-that-turn"


@pytest.fixture()
def write(tmp_path: Path) -> Write:
    """Write a file below a small repository in which (1) is implemented and held, and (2) needs no function."""

    def put(path: Path, text: str) -> None:
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text, encoding="utf-8")

    put(CODE, 'def mass():\n    """Total mass (1)."""\n')
    put(TEST, 'def test_mass():\n    """(1) of a sum."""\n')
    put(Path("docs/errata.md"), "# Errata of Q\n\n## (1): not of this paper\n\n# Errata of P\n\n## (2): a sign\n")
    return put


def _paper(none: str = "notation") -> Paper:
    equations = (Equation("1", "Bodies", "mass", ""), Equation("2", "Bodies", "name", none))
    return Paper("P", "A. Paper", SOURCES, "errata.md", 2, equations)


def test_faultless(tmp_path: Path, write: Write) -> None:
    index = Index.of(_paper(), tmp_path)
    assert index.faults() == []
    text = page([index], tmp_path)
    assert "[`frisch.mass.mass`](../flexmb/frisch/mass.py) | [`test_mass`](../tests/flexmb/frisch/test_mass.py)" in text
    assert "[erratum](errata.md#2-a-sign)" in text and "none needed: notation" in text
    assert "not-of-this-paper" not in text


@pytest.mark.parametrize(
    ("path", "text", "fault"),
    [
        (CODE, 'def mass():\n    """(1), (3)"""\n', "cites (3), which does not exist"),
        (CODE, 'def mass():\n    """(0), (1)"""\n', "cites (0), which does not exist"),
        (CODE, '"""Module: (1)-(7)."""\ndef mass():\n    """(1)"""\n', "cites (7), which does not exist"),
        (Path("flexmb/jain/a.py"), 'def f():\n    """As in Frisch (4)."""\n', "cites (4), which does not exist"),
        (CODE, 'def mass():\n    """(1), (2)"""\n', "(2) is cited by flexmb/frisch/mass.py mass: take the reason out"),
        (CODE, '"""(1)"""\ndef mass():\n    pass\n', "(1) mass: no function cites it"),
        (CODE, "# (1)\ndef mass():\n    pass\n", "(1) mass: no function cites it"),
        (CODE, "def mass():\n    return 1  # (1), (5)\n", "cites (5), which does not exist"),
        (TEST, 'def reference():\n    """(1)"""\n', "(1) is cited by flexmb/frisch/mass.py mass, but by no test"),
        (TEST, '"""(1)"""\ndef test_mass():\n    pass\n', "(1) is cited by flexmb/frisch/mass.py mass, but by no test"),
    ],
)
def test_a_fault_is_seen(tmp_path: Path, write: Write, path: Path, text: str, fault: str) -> None:
    write(path, text)
    assert any(fault in found for found in Index.of(_paper(), tmp_path).faults())


def test_a_range_passes_over_what_needs_no_function(tmp_path: Path, write: Write) -> None:
    write(CODE, 'def mass():\n    """(1)-(2)"""\n')
    assert Index.of(_paper(), tmp_path).faults() == []
    assert any("(2)" in fault for fault in Index.of(_paper(none=""), tmp_path).faults())


def test_faults_of_the_data_file(tmp_path: Path, write: Write) -> None:
    assert any("no reason is given" in fault for fault in Index.of(_paper(none=""), tmp_path).faults())
    assert any("its reason names (9)" in fault for fault in Index.of(_paper(none="see (9)"), tmp_path).faults())
    paper = _paper()
    short = Paper(paper.title, paper.reference, paper.sources, paper.errata, paper.last, paper.equations[:1])
    assert any("does not list (1) to (2)" in fault for fault in Index.of(short, tmp_path).faults())


def test_a_changed_citation_changes_the_page(tmp_path: Path, write: Write) -> None:
    before = page([Index.of(_paper(), tmp_path)], tmp_path)
    write(Path("crosscheck/frisch.py"), 'def engine():\n    """Frisch (1) again."""\n')
    assert page([Index.of(_paper(), tmp_path)], tmp_path) != before
