"""Versions agree, the Python range is one and the same everywhere, extras have a use, the citation is one."""

import re
from datetime import date
from importlib.metadata import version

import pytest
import yaml

from tests.repo.project import PYPROJECT, ROOT

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
    "drake": "import pydrake", "bsk": "import Basilisk", "cmeel-eigen": "include/eigen3",
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
