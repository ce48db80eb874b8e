"""docs/architecture.md agrees with the tree and the import contracts; each check is shown a page that is wrong."""

import re

import pytest

from tests.repo import architecture as a
from tests.repo.project import ROOT

PAGE = a.PAGE.read_text(encoding="utf-8")
ORDER = [("report", "verify"), ("judging",), ("library",)]  # stands for a contract


@pytest.mark.parametrize("package", a.PACKAGES)
def test_every_room_once_in_the_order_of_the_layers(package: str) -> None:
    assert not a.faults_of_rooms(PAGE, package, a.layers(package))


def test_the_layers_are_those_of_the_contracts() -> None:
    contained = {"type": "layers", "containers": ["crosscheck"], "layers": ["(report) | verify", "judging : running"]}
    others = [{"type": "forbidden"}, contained]
    assert a.layers("crosscheck", others) == [("report", "verify"), ("judging", "running")]
    assert a.layers("flexmb", others) == []


@pytest.mark.parametrize("package", a.PACKAGES)
def test_every_room_has_a_layer(package: str) -> None:
    """The contract is exhaustive, too; here the rooms are counted without import-linter."""
    assert sorted(room for layer in a.layers(package) for room in layer) == sorted(a.rooms(package))


@pytest.mark.parametrize(
    "wrong, fault",
    [
        (re.sub(r"\| `judging` .*\n", "", PAGE), "crosscheck.judging is listed 0 times"),
        (re.sub(r"(\| `judging` .*\n)", r"\1\1", PAGE), "crosscheck.judging is listed 2 times"),
        (PAGE.replace("| `judging` |", "| `judgement` |"), "crosscheck.judgement does not exist"),
        (re.sub(r"(\| `judging` .*\n)([^#]*)(\| `library` .*\n)", r"\3\2\1", PAGE), "crosscheck.judging stands below"),
    ],
)
def test_a_wrong_list_of_rooms_is_noticed(wrong: str, fault: str) -> None:
    assert any(room.startswith(fault) for room in a.faults_of_rooms(wrong, "crosscheck", ORDER))


@pytest.mark.parametrize("page", ["docs/architecture.md", "docs/reading.md", "CONTRIBUTING.md", "README.md"])
def test_every_file_and_name_exists(page: str) -> None:
    assert not a.faults_of_names((ROOT / page).read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    "text, faults",
    [
        ("`flexmb/hinges/spheroidal.py`", ["flexmb/hinges/spheroidal.py does not exist"]),
        ("`flexmb/hinge/<kind>.py`", ["flexmb/hinge/<kind>.py does not exist"]),
        ("`flexmb/run/simulate.py:simulation`", ["flexmb/run/simulate.py does not define simulation"]),
        ("`flexmb/hinges/<kind>.py`, `flexmb/run/simulate.py:simulate`, `flexmb/tables/arrays.py:BODY`", []),
    ],
)
def test_a_wrong_name_is_noticed(text: str, faults: list[str]) -> None:
    assert a.faults_of_names(text) == faults


@pytest.mark.parametrize("what", a.RECIPES)
def test_every_recipe_names_files(what: str) -> None:
    assert re.search(r"`(flexmb|crosscheck|cases)/", a.recipe(PAGE, what))
    assert not a.recipe(PAGE.replace(f"**Add {what}.**", ""), what)


def test_the_glossary_has_the_letters_that_kernels_share() -> None:
    known = set(re.findall(r"`(\w{1,2})`", a.section(PAGE, "Glossary of the kernels' letters")))
    shared = a.shared_letters()
    assert {"c", "w", "k"} <= shared
    assert not shared - known


def test_the_picture_is_drawn_from_the_contracts() -> None:
    """Write it with `python -m tests.repo.architecture`."""
    assert a.PICTURE.read_text(encoding="utf-8") == a.picture()


def test_the_picture_shows_every_room() -> None:
    drawn = re.findall(r"<text [^>]*?\d\">(\w+)</text>", a.picture())
    assert sorted(drawn) == sorted(room for package in a.PACKAGES for room in a.rooms(package))
