"""Versions agree, and the Python range is one and the same everywhere."""

from __future__ import annotations

import re
from importlib.metadata import version

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
