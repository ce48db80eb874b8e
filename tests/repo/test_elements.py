"""Every element of a scene that exerts, measures, controls or happens has its tests and its row: elements.toml."""

import ast
import tomllib
from functools import cache
from pathlib import Path
from typing import Any, get_args

import pytest

from flexmb.scene.connectors import Connector
from flexmb.scene.control import Controller, Sensor
from flexmb.scene.events import Action
from flexmb.scene.schema import Load
from tests.repo.project import ROOT

TABLE: dict[str, dict[str, str]] = tomllib.loads((Path(__file__).parent / "elements.toml").read_text(encoding="utf-8"))
CELLS = {"balance", "reaction", "twin", "derivative", "peer"}
KINDS = {kind.__name__ for union in (Connector, Sensor, Controller, Action) for kind in get_args(union)}
REFERENCE = (ROOT / "docs" / "scene-reference.md").read_text(encoding="utf-8")


def faults(table: dict[str, dict[str, str]], kinds: set[str], reference: str) -> list[str]:
    """What is missing from a table of elements, and what it names that there is not."""
    found = [f"{kind} has no entry" for kind in sorted(kinds - table.keys())]
    found += [f"{kind} is no element" for kind in sorted(table.keys() - kinds)]
    for kind, cells in table.items():
        found += [f"{kind} says nothing of its {cell}" for cell in sorted(CELLS - cells.keys())]
        found += [f"{kind} has no row in the reference"] * (f"\n## {kind}" not in reference)
        for cell, shown in cells.items():
            if shown.startswith("none: "):
                continue
            path, _, test = shown.partition(":")
            if test not in names_in(path):
                found.append(f"the {cell} of {kind}: there is no {shown}")
    return found


@cache
def names_in(path: str) -> frozenset[str]:
    """Names of the tests of a file; none where there is no such file."""
    file = ROOT / path
    if not file.is_file():
        return frozenset()
    tree: Any = ast.parse(file.read_text(encoding="utf-8"))
    return frozenset(each.name for each in tree.body if isinstance(each, ast.FunctionDef) and each.name[:5] == "test_")


def test_every_element_has_its_tests() -> None:
    assert not faults(TABLE, KINDS | {Load.__name__}, REFERENCE)


@pytest.mark.parametrize(("entry", "fault"), [
    (None, "Spring has no entry"),
    ({}, "Spring says nothing of its balance"),
    ({"balance": "tests/repo/test_elements.py:test_nothing"}, "there is no tests/repo/test_elements.py:test_nothing"),
    ({"twin": "tests/nowhere.py:test_it"}, "there is no tests/nowhere.py:test_it"),
    ({"peer": "none: nobody has it"}, "Spring has no row in the reference"),
])  # fmt: skip
def test_what_is_missing_is_noticed(entry: dict[str, str] | None, fault: str) -> None:
    table = {} if entry is None else {"Spring": entry}
    assert any(fault in each for each in faults(table, {"Spring"}, "# nothing"))
