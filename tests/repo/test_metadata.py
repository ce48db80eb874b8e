"""Versions agree, the Python range is one and the same everywhere, extras have a use, messages name what pip finds, the
citation is one, the paper has its form, and no file names a path of somebody's machine.
"""

import re
import tomllib
from collections.abc import Iterator
from datetime import date
from importlib.metadata import version

import pytest
import yaml

from tests.repo.project import PYPROJECT, ROOT, text_files

VERSION = PYPROJECT["project"]["version"]


def test_one_version() -> None:
    citation = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert citation is not None and citation[1] == VERSION
    assert version("flexmb") == VERSION


def test_changelog_knows_the_version_or_an_unreleased_one() -> None:
    headings = re.findall(r"^## \[(.+?)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert headings[0] in ("Unreleased", VERSION)


def test_readme_names_the_supported_pythons() -> None:
    classifiers = PYPROJECT["project"]["classifiers"]
    pythons = [c.rpartition(" ")[2] for c in classifiers if re.search(r"Python :: 3\.\d+$", c)]
    low, high = re.fullmatch(r">=(3\.\d+),<3\.(\d+)", PYPROJECT["project"]["requires-python"]).groups()
    assert pythons == [f"3.{minor}" for minor in range(int(low[2:]), int(high))]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert all(python in readme for python in pythons)


# How the use of a distribution looks, where it is not `import name` or `from name`: another module, a tool, a fixture.
SIGNS = {
    "pin": "import pinocchio", "dask": "distributed import", "pytest-benchmark": "benchmark(", "pytest-xdist": "--dist",
    "import-linter": "importlinter.cli import", "ruff": '"ruff", "check"', "mypy": '"-m", "mypy"',
    "hatchling": '"hatchling", "build"', "pyyaml": "import yaml", "mutmut": "mutmut run",
    "rerun-sdk": "import rerun", "selenium": "importorskip(\"selenium", "sphinx": "\"-m\", \"sphinx\"",
    "furo": "html_theme = \"furo\"", "myst-parser": "\"myst_parser\"",
    "drake": "from pydrake", "bsk": "from Basilisk", "cmeel-eigen": "include/eigen3",
    "ziglang": '"-m", "ziglang"', "wasmtime": 'importorskip("wasmtime',
    "KratosStructuralMechanicsApplication": "import KratosMultiphysics.StructuralMechanicsApplication",
}  # fmt: skip
EXTRAS = PYPROJECT["project"]["optional-dependencies"]


def used(distribution: str) -> bool:
    """Whether any source, or a page that says what to run, uses a distribution."""
    name = distribution.replace("-", "_")
    signs = [SIGNS[distribution]] if distribution in SIGNS else [f"import {name}", f"from {name}"]
    files = [file for folder in ("flexmb", "crosscheck", "tests") for file in (ROOT / folder).rglob("*.py")]
    files += [ROOT / "CONTRIBUTING.md", ROOT / "docs" / "conf.py", ROOT / "docs" / "mutation-testing.md"]
    own = ROOT / "tests" / "repo" / "test_metadata.py"
    texts = (file.read_text(encoding="utf-8") for file in files if file != own)
    return any(sign in text for text in texts for sign in signs)


@pytest.mark.parametrize("extra", EXTRAS)
def test_every_extra_has_a_use(extra: str) -> None:
    """What it installs is imported, or is a tool that is run: an extra that nothing uses promises what is not there."""
    names = [re.split(r"[^\w-]", requirement)[0] for requirement in EXTRAS[extra]]
    assert names and not [name for name in names if not used(name)]


def test_a_distribution_without_a_use_is_found() -> None:
    assert used("numpy") and not used("tensorflow")


def test_the_citation_is_one() -> None:
    """What the Citation File Format 1.2.0 demands, and what our files must agree on."""
    found = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert found["cff-version"] == "1.2.0" and found["type"] == "software"
    assert {"message", "title", "authors", "version", "license"} <= set(found)
    for work in (found, *found["references"]):
        assert work["title"] and work["authors"]
        assert all({"name"} <= set(author) or {"family-names"} <= set(author) for author in work["authors"])
    assert all("type" in work for work in found["references"])
    assert found["license"] == PYPROJECT["project"]["license"]


def test_the_address_of_the_repository_is_one() -> None:
    """None until there is a public one, then the same in all places."""
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    address = PYPROJECT["project"].get("urls", {}).get("Repository")
    assert citation.get("repository-code") == address
    action = f"{address.rpartition('/')[0].rpartition('/')[2]}/" if address else "./.github/actions/crosscheck"
    page = (ROOT / "docs" / "ci.md").read_text(encoding="utf-8")
    assert f"uses: {action}" in page and "OWNER" not in page
    assert ("no public address" in page) is (address is None)


def test_actions_are_pinned_by_their_commits() -> None:
    """A tag can be moved: what is not in the repository itself is named by a commit, with the release behind it."""
    used = re.findall(r"uses: (\S+)(.*)$", (ROOT / "docs" / "ci.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert used
    for action, release in used:
        pinned = re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40}", action) and re.fullmatch(r" # v\d+\.\d+\.\d+", release)
        assert pinned or action.startswith("./"), action


def test_the_changelog_has_versions_with_dates_and_kinds_of_changes() -> None:
    """Keep a Changelog: newest first, each version dated, changes under six headings."""
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## (.+)$", text, flags=re.MULTILINE)
    dated = [re.fullmatch(r"\[(\d+\.\d+\.\d+)\] - (\d{4}-\d\d-\d\d)", heading) for heading in headings]
    assert headings[0] == "[Unreleased]" or dated[0]
    assert all(dated[1:])
    days = [date.fromisoformat(found[2]) for found in dated if found]
    assert days == sorted(days, reverse=True)
    kinds = set(re.findall(r"^### (.+)$", text, flags=re.MULTILINE))
    assert kinds <= {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}


ASKED = re.compile(r"""pip install (?:--?[\w-]+ )*["']*([A-Za-z][\w.-]*(?:\[[\w,-]+\])?)""")
DECLARED = re.compile(r'''Library\("[^"]+", [^,]+, "([^"]+)"\)''')  # of adapters, whose remedy is put together
DISTRIBUTION = re.compile(r"[A-Za-z][\w.-]*(?:\[[\w,-]+\])?")
NOT_OURS = {"control"}  # python-control, to whose objects a linear model can be given


def remedies() -> Iterator[tuple[str, str]]:
    """File and distribution of every remedy in the sources that is written out, or of a library that is declared."""
    for package in ("flexmb", "crosscheck"):
        for file in sorted((ROOT / package).rglob("*.py")):
            text = file.read_text(encoding="utf-8")
            for name in (*ASKED.findall(text), *DECLARED.findall(text)):
                yield str(file.relative_to(ROOT)), name


def optional() -> set[str]:
    """The distributions of the optional dependencies, other than this project's own extras."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    names = {DISTRIBUTION.match(text)[0] for group in extras.values() for text in group}  # type: ignore[index]
    return {name for name in names if not name.startswith("flexmb")}


def test_remedies_name_distributions_that_pip_finds() -> None:
    known, found = optional() | NOT_OURS, list(remedies())
    assert len(found) >= 12
    assert [(file, name) for file, name in found if name not in known] == []


def test_extras_of_this_project_are_no_remedy() -> None:
    assert ASKED.findall("JAX is missing: pip install 'flexmb[jax]'") == ["flexmb[jax]"]
    assert "flexmb[jax]" not in optional() and "dask[distributed]" in optional()


HEAD, _, TEXT = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8").removeprefix("---\n").partition("\n---\n")
BIBLIOGRAPHY = (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8")
SECTIONS = [
    "Summary", "Statement of need", "State of the field", "Software design", "Research impact statement",
    "AI usage disclosure", "Acknowledgements", "References",
]  # fmt: skip
ENTRY = re.compile(r"^@(\w+)\{(\w+),\n(.*?)^\}", re.M | re.S)


def test_the_head_has_what_the_journal_reads() -> None:
    head = yaml.safe_load(HEAD)
    assert {"title", "tags", "authors", "affiliations", "date", "bibliography"} <= set(head)
    assert (ROOT / "paper" / head["bibliography"]).is_file()
    places = {affiliation["index"] for affiliation in head["affiliations"]}
    assert {author["affiliation"] for author in head["authors"]} <= places
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert [author["name"] for author in head["authors"]] == [author["name"] for author in citation["authors"]]


def test_sections_and_length() -> None:
    """The sections that are required since 2026, in their order, and between 750 and 1750 words."""
    assert re.findall(r"^# (.+)$", TEXT, re.M) == SECTIONS
    assert 750 <= len(TEXT.split()) <= 1750


def test_what_is_cited_is_in_the_bibliography_and_nothing_else() -> None:
    entries = {key: fields for _, key, fields in ENTRY.findall(BIBLIOGRAPHY)}
    assert set(re.findall(r"@(\w+)", TEXT)) == set(entries)
    for key, fields in entries.items():
        known = dict(re.findall(r"^  (\w+) = \{(.*)\},?$", fields, re.M))
        assert {"title", "author", "year"} <= set(known) and key.endswith(known["year"]), key
        assert re.fullmatch(r"10\.\d{4,}/\S+", known.get("doi", "10.0000/none")), key
    found = re.findall(r"^  doi = \{(.*)\}", BIBLIOGRAPHY, re.M)
    assert len(set(found)) == len(found) >= len(entries) - 2  # a report and a site have none


# An absolute path below a home, a scratch or a mount folder, or a package index other than by its public name.
MACHINE = re.compile(
    r"(?<![\w.:/-])/(?:work|root|home|Users|tmp|opt|mnt|data)/[\w.]|[A-Z]:\\\\|index-url|find-links|localhost:\d"
)


def test_no_machine_paths() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in text_files()
        if path.resolve() != ROOT / "tests" / "repo" / "test_metadata.py"
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if MACHINE.search(line)
    ]
    assert not found, "\n".join(found)


def test_the_pattern_finds_what_it_looks_for() -> None:
    assert MACHINE.search("open('/home/me/scene.toml')")
    assert not MACHINE.search("https://example.org/home/page")
