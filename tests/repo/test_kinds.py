"""Every place that tells kinds apart knows all of them: what is none of them is refused, by the type checker first."""

import ast
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

from crosscheck.engines.links import Freedom as Joint
from crosscheck.library import time_functions
from flexmb.control.wiring import _LAWS
from flexmb.scene import schema as s
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.freedoms import Freedom
from tests.repo.kinds import kinds_of, silent_places
from tests.repo.project import ROOT

MEANT = {  # what else means there
    "flexmb/hinges/gimbal2.py": "asked whether a hinge is its own: None for all others",
    "flexmb/building/links.py": "a link is a body of any kind, or a point mass",
}
SILENT = {
    "an unfinished match": """
def f(hinge):
    match hinge:
        case Revolute():
            return 1
        case Prismatic():
            return 2
    return 3
""",
    "a match with a wild last case": """
def f(body):
    match body:
        case s.RigidBody():
            return 1
        case s.BeamBody() | s.ModalBody():
            return 2
        case _:
            return 3
""",
    "an else": """
def f(connector):
    if isinstance(connector, AngularSpring):
        return 1
    else:
        return 2
""",
    "a chain without an end": """
def f(sensor):
    if isinstance(sensor, TimeSensor):
        return 1
    elif isinstance(sensor, LoadSensor):
        return 2
""",
    "one of two values": "def f(c):\n    return 1.0 if isinstance(c, AngularCoordinate) else 2.0\n",
}
KNOWING = {
    "an exhaustive match": """
def f(hinge):
    match hinge:
        case Revolute():
            return 1
        case Prismatic():
            return 2
        case _:
            assert_never(hinge)
""",
    "a refusal": """
def f(hinge):
    match hinge:
        case Revolute() | Prismatic():
            return 1
        case Weld():
            return 2
    raise ValueError(hinge.name)
""",
    "a filter": "def f(bodies):\n    return [longer(x) if isinstance(x, BeamBody) else x for x in bodies]\n",
}


@pytest.mark.parametrize("package", ["flexmb", "crosscheck"])
def test_no_place_takes_a_new_kind_for_another(package: str) -> None:
    found = {}
    for file in sorted((ROOT / package).rglob("*.py")):
        name = file.relative_to(ROOT).as_posix()
        if places := list(silent_places(file.read_text(encoding="utf-8"))):
            found[name] = places
    assert {name: places for name, places in found.items() if name not in MEANT} == {}
    assert [name for name in MEANT if name.startswith(package)] == [name for name in MEANT if name in found]


@pytest.mark.parametrize("source", SILENT.values(), ids=SILENT)
def test_a_silent_place_is_found(source: str) -> None:
    assert len(list(silent_places(source))) == 1


@pytest.mark.parametrize("source", KNOWING.values(), ids=KNOWING)
def test_a_place_that_knows_all_kinds_or_changes_some_is_none(source: str) -> None:
    assert list(silent_places(source)) == []


def test_tables_by_kind_have_every_kind() -> None:
    functions = set(get_args(s.Function))
    assert all(set(table) == functions for table in
               (time_functions.VALUES, time_functions.TIMES, time_functions.FREQUENCIES))
    assert set(_LAWS) == set(get_args(s.Controller)) - {s.UserLaw}


# One more kind of each union that is told apart by `match`: its file, the name of the union, and what the kind is.
MADE_UP = {
    "connectors": ("flexmb/scene/connectors.py", "BetweenNodes", "SceneStruct"),
    "bodies": ("flexmb/scene/bodies.py", "Body", "SceneStruct"),
    "freedoms": ("flexmb/scene/freedoms.py", "Freedom", "NamedTuple"),
    "joints of peers": ("crosscheck/engines/links.py", "Freedom", "object"),
    "functions of time": ("flexmb/scene/functions.py", "Function", "_Function"),
}
KINDS = {
    "connectors": BetweenNodes, "bodies": s.Body, "freedoms": Freedom, "joints of peers": Joint,
    "functions of time": s.Function,
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("union", MADE_UP)
def test_the_type_checker_finds_every_place_that_does_not_know_a_new_kind(union: str, tmp_path: Path) -> None:
    """Adapters are not among the files whose types are checked: here they are, for this error alone."""
    for package in ("flexmb", "crosscheck"):
        for file in (ROOT / package).rglob("*.py"):
            copy = tmp_path / file.relative_to(ROOT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(file.read_bytes())
    (tmp_path / "pyproject.toml").write_bytes((ROOT / "pyproject.toml").read_bytes())
    names = {kind.__name__ for kind in get_args(KINDS[union])}
    knowing = [name for name in _by_match(tmp_path, names) if name != MADE_UP[union][0]]
    if union == "connectors":  # adapters have a union of those that they know, and refuse others
        knowing = [name for name in knowing if not name.startswith("crosscheck/engines/")]
    assert _unfinished(tmp_path, knowing) == set()
    name, alias, base = MADE_UP[union]
    text = (tmp_path / name).read_text(encoding="utf-8")
    more = f"class MadeUp({base}):\n    name: str\n    file: str\n\n\n{alias} = MadeUp | "
    (tmp_path / name).write_text(text.replace(f"\n{alias} = ", f"\n{more}", 1), encoding="utf-8")
    assert _unfinished(tmp_path, knowing) == set(knowing)


def _by_match(root: Path, names: set[str]) -> list[str]:
    """The files that have an exhaustive match over all of these kinds."""
    found = []
    for file in sorted([*root.glob("flexmb/**/*.py"), *root.glob("crosscheck/**/*.py")]):
        nodes = ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        matches = [node for node in nodes if isinstance(node, ast.Match)]
        ended = [match for match in matches if "assert_never" in ast.unparse(match.cases[-1])]
        if any(names <= kinds_of(match) for match in ended):
            found.append(file.relative_to(root).as_posix())
    return found


def _unfinished(root: Path, files: list[str]) -> set[str]:
    """The files in which a match does not know all kinds, by mypy."""
    command = [sys.executable, "-m", "mypy", *files]
    run = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    return {line.split(":")[0] for line in run.stdout.splitlines() if 'to "assert_never"' in line}
