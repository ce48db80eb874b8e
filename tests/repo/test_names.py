"""Names lead somewhere: what pages, docstrings and comments mention exists, and a class has one name in the house."""

import ast
import re
from collections import Counter
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import pytest

from tests.repo.project import ROOT, text_files

PACKAGES = ("flexmb", "crosscheck", "tests")
DOTTED = re.compile(rf"(?<![\w./-])(?:{'|'.join(PACKAGES)})(?:\._?[a-z]\w*)+")
FILE = re.compile(r"(?<![\w./-])(?:flexmb|crosscheck|tests|docs|cases)/[\w/.-]*\w\.(?:py|md|toml|svg|png|json)\b")
# Tests of such checks, and of files that are edited, make up names; the changelog speaks of places that were.
ELSEWHERE = {
    ROOT / "CHANGELOG.md",
    ROOT / "tests" / "flexmb" / "jit" / "test_cache.py",
    *(ROOT / "tests" / "repo" / f"test_{what}.py" for what in ("names", "equations", "architecture")),
}


def unknown_names(text: str) -> list[str]:
    """Dotted names and paths in a text that lead nowhere."""
    files = [name for name in FILE.findall(text) if not (ROOT / name).exists()]
    return files + [name for name in DOTTED.findall(text) if not _is_known(name)]


@cache
def _is_known(name: str) -> bool:
    """Whether a dotted name is a module, or something that the innermost module on its way mentions."""
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        place = ROOT.joinpath(*parts[:count])
        for module in (place.with_suffix(".py"), place / "__init__.py"):
            if module.exists():
                rest = parts[count : count + 1]
                return not rest or bool(re.search(rf"\b{rest[0]}\b", module.read_text(encoding="utf-8")))
        if place.is_dir():
            return count == len(parts)
    return False


def _prose(path: Path) -> str:
    """All of a page; of Python the text between triple quotes and behind a hash."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        return text
    return "\n".join(re.findall(r'"""[\s\S]*?"""|#[^\n]*', text))


def test_every_name_leads_somewhere() -> None:
    found = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in text_files()
        if path.suffix in (".md", ".py") and path not in ELSEWHERE
        for name in unknown_names(_prose(path))
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "text, found",
    [
        ("see `flexmb.precision`", ["flexmb.precision"]),
        ("see flexmb.run.simulate.simulated.", ["flexmb.run.simulate.simulated"]),
        ("see docs/notes.md", ["docs/notes.md"]),
        ("see `flexmb.run.simulate.simulate`, flexmb.jain, docs/notation.md and flexmb.compile", []),
    ],
)
def test_a_name_that_leads_nowhere_is_found(text: str, found: list[str]) -> None:
    assert unknown_names(text) == found


# What an engine hands over and what flexmb gives its users are the same things, in two shapes.
SHARED = {"MarkerPath", "Trajectory"}


def repeated_classes(sources: Iterable[str]) -> set[str]:
    """Names that more than one class has, private ones too."""
    nodes = (node for source in sources for node in ast.walk(ast.parse(source)))
    names = Counter(node.name for node in nodes if isinstance(node, ast.ClassDef))
    return {name for name, times in names.items() if times > 1}


def test_a_class_has_one_name_in_the_house() -> None:
    files = [path for package in ("flexmb", "crosscheck") for path in (ROOT / package).rglob("*.py")]
    assert repeated_classes(path.read_text(encoding="utf-8") for path in files) == SHARED


def test_a_second_class_of_one_name_is_found() -> None:
    assert repeated_classes(["class A: ...\nclass B: ...", "def f():\n    class A: ..."]) == {"A"}
