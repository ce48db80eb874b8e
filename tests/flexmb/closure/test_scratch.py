"""No pass over a closed chain reads what another one has left in scratch: who writes the loads that act, and every door
again with the scratch poisoned in between."""

from __future__ import annotations

import ast
import gc
import re
from collections.abc import Callable, Collection, Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.closure import dynamics
from flexmb.closure.tables import Closed, ClosureWorkspace
from flexmb.closure.variation import ChainVariation
from flexmb.jit.counting import Interpreter, _counting, _scalars
from flexmb.scene.schema import Scene
from flexmb.tables.arrays import Workspace
from tests.flexmb.closure.test_jacobian import MOVING
from tests.repo.project import ROOT

pytestmark = pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
LIBRARY = [
    each.parent
    for each in sorted((ROOT / "cases").glob("*/*/scene.toml"))
    if (scene := msgspec.toml.decode(each.read_bytes())).get("closures") or scene.get("couplings")
]
# Who writes loads of rows. In a chain: the solution for them, its refinement, and two that prescribe them.
WRITERS = {
    "closure/forces.py": {"row_loads", "_refine"},
    "closure/closures.py": {"_under"},
}
# In workspaces of dual numbers, which take what acts in the chain, and change it along every direction.
OF_DUALS = {
    "closure/tangent.py": {"change_by_time", "evaluate_held", "_hold_rows"},
    "sensitivity/chain.py": {"under_loads"},
    "export/entry.py": {"chain_outputs_along"},
}
# What belongs to whoever fills it until the next pass of a kernel, which does not read it.
SCRATCH = {"scratch", "solution", "shared", "coefficient", "step"}
# What one call finds, as long as no other call has been made.
FOUND = {"closure", "row", "half", "basis", "factor", "shared_factor", "response", "vanishing", "demand"}
# What lasts: counted rows, where a run has been, and settings.
KEPT = {
    "chosen", "rank", "size", "former", "former_pivot", "former_rows", "state", "resolved", "notices", "noticed",
    "closer", "time", "gain", "failure",
}  # fmt: skip


# Of workspaces of trees: where ports are at rest, and the ground, are there from the beginning.
LASTS_IN_TREES = {"port", "ground", "displaced"}


def test_every_field_is_scratch_or_found_or_kept() -> None:
    """A new one has to be decided about."""
    assert {field.name for field in fields(ClosureWorkspace)} == SCRATCH | FOUND | KEPT
    assert len(SCRATCH) + len(FOUND) + len(KEPT) == len(fields(ClosureWorkspace))


LOAD = r"\brow\[(.*\]\.load|['\"]load['\"]\])"


def writers(path: Path) -> Iterator[str]:
    """Functions that assign to `load` of a row of a closed chain."""
    text = path.read_text(encoding="utf-8")
    for function in ast.walk(ast.parse(text)) if re.search(LOAD, text, re.MULTILINE) else ():
        if isinstance(function, ast.FunctionDef):
            for node in ast.walk(function):
                for target in node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]:
                    if target is not None and re.fullmatch(f".*{LOAD}", ast.unparse(target)):
                        yield function.name


def test_only_these_write_the_loads_that_act() -> None:
    """`factor.solve`, by which whatever moves a chain is found, does not."""
    package = Path(fm.__file__).parent  # as installed
    paths = sorted(package.rglob("*.py"))
    found = {path.relative_to(package).as_posix(): set(writers(path)) for path in paths}
    assert {name: functions for name, functions in found.items() if functions} == WRITERS | OF_DUALS


def written() -> list[Any]:
    """What calls write, of all workspaces of closures and trees that there are."""
    # By their types alone: `isinstance` asks a weak proxy, of which compilers leave some, for what is no longer there.
    spaces = [each for each in gc.get_objects() if issubclass(type(each), ClosureWorkspace | Workspace)]
    of_trees = {each.name for each in fields(Workspace)} - LASTS_IN_TREES
    return [
        getattr(each, name) for each in spaces
        for name in (SCRATCH | FOUND if isinstance(each, ClosureWorkspace) else of_trees)
    ]  # fmt: skip


def poison(table: Any) -> None:
    """Set all real numbers of an array, a table or a bundle to NaN, but for the speeds that a run remembers, and for
    zeros: whole vectors are read of what has fewer entries, and the rest is zero."""
    if is_dataclass(table):
        for field in fields(table):
            poison(getattr(table, field.name))
    elif table.dtype.names:
        for name in table.dtype.names:
            if name != "former_speed":
                poison(table[name])
    elif table.dtype.kind == "f":
        table[table != 0.0] = np.nan


def doors(system: fm.System) -> dict[str, Callable[[], list[np.ndarray]]]:
    """What may be asked of a closed chain, at its start and a little later."""
    start, evaluator = system.initial_state, system.derivative_evaluator() if differentiable(system) else None

    def motion() -> list[np.ndarray]:
        found = system.evaluate(start.t, start.q, start.u)
        return [system.accelerations(start), *(load for load in found.loads.values())]

    def derivatives() -> list[np.ndarray]:
        assert evaluator is not None
        rates = evaluator(start.t, start.q, start.u)
        return [rates.copy(), evaluator.by_displacement.copy(), evaluator.by_speed.copy(), evaluator.by_force.copy()]

    def dense() -> list[np.ndarray]:
        found = system.acceleration_derivatives(start)
        return [found.accelerations, found.by_displacement, found.by_speed, found.by_force]

    def run(method: fm.Method) -> Callable[[], list[np.ndarray]]:
        def go() -> list[np.ndarray]:
            done = fm.simulate(system, start.t + 0.01, method, samples=3, rtol=1e-6, atol=1e-8)
            return [done.q, done.u]

        return go

    found = {"motion": motion, "gaps": lambda: [np.array(list(system.closure_gaps(start).values()))],
             "run": run("dop853")}  # fmt: skip
    if evaluator is not None:
        found |= {"derivatives": derivatives, "dense": dense, "implicit": run("radau5")}
    return found


def differentiable(system: fm.System) -> bool:
    return not (system.scene.controllers or system.closures.at_rest)


def same(one: list[np.ndarray], other: list[np.ndarray]) -> bool:
    return len(one) == len(other) and all(
        np.array_equal(*pair, equal_nan=True) for pair in zip(one, other, strict=True)
    )


def scenes() -> dict[str, Callable[[], Scene]]:
    library = {"/".join(each.parts[-2:]): lambda each=each: fm.load_scene(each / "scene.toml") for each in LIBRARY}
    return library | MOVING


LIGHT = "random loops 44, light 1e-08"  # whose loads are refined
QUICK = {
    "closed_chains/bennett", "closed_chains/geared_hoist", "closed_chains/flexible_four_bar", "coupled and closed",
    "connected", "windows", "driven flexible four-bar", LIGHT,
}  # fmt: skip


@pytest.mark.parametrize("name", [
    name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in scenes()
])  # fmt: skip
def test_every_door_answers_the_same_with_poisoned_tables(name: str) -> None:
    """Nor what another call has found. The answers without poison came one after the other."""
    system = fm.compile(scenes()[name]())
    asked = doors(system)
    expected = {each: ask() for each, ask in asked.items()}
    tables = written()
    for each, ask in reversed(asked.items()):
        for table in tables:
            poison(table)
        assert same(ask(), expected[each]), each


@pytest.mark.parametrize("name", ["driven flexible four-bar", "closed_chains/geared_hoist"])
def test_the_change_of_coordinates_leaves_the_motion_as_it_is(name: str) -> None:
    """N is found last, elsewhere than the motion: whoever reads the chain afterwards finds the state that was asked.

    Both have no quaternions, so that N is found once, at other coordinates. It was found in the chain.
    """
    system = fm.compile(scenes()[name]())
    state, variation = system.initial_state, ChainVariation(system.closures, system.own_tangent)
    found, w = variation.at(state.t, state.y), variation._chain.w
    assert np.any(state.q) and np.array_equal(w.q, state.q) and np.array_equal(w.u, state.u)
    assert np.array_equal(w.speed["acceleration"], found.accelerations)
    poison(w)
    assert np.array_equal(variation.motion.at(state.y), found.motion)


class Poisoning(Interpreter):
    """Interprets kernels, with the scratch poisoned before every function of `passes`."""

    def __init__(self, workspace: ClosureWorkspace, poisoned: Collection[str]) -> None:
        super().__init__(SCALAR)
        self._workspace, self._fields, self.met = workspace, poisoned, set[str]()

    def _function(self, function):
        twin = super()._function(function)
        if (function.__module__, function.__name__) not in PASSES:
            return twin

        def poisoned(*arguments):
            for name in self._fields:
                getattr(self._workspace, name)[:] = SCALAR(np.nan)
            self.met.add(function.__name__)
            return twin(*arguments)

        return poisoned


SCALAR = _scalars({name: 0 for name in ("additions", "multiplications", "divisions", "square_roots", "elementary")})
PASSES = {(f"flexmb.closure.{module}", name) for module, names in {
    "forces": ("_tree_and_rows", "_accelerate", "_refine", "_hinge_loads", "_locate", "row_loads", "choose"),
    "generalised": ("tree_and_rows", "accelerate", "hinge_and_drive_loads", "locate"),
    "sizes": ("measure_ports",),
    "projection": ("close",),
}.items() for name in names}  # fmt: skip


def interpreted(chain: Closed, y: np.ndarray, poisoned: Collection[str]) -> tuple[list[np.ndarray], set[str]]:
    """Slope, loads and projection of y by interpreted kernels, and the names of the passes."""
    s = _counting(chain, SCALAR)
    if chain.seen is chain.w:
        object.__setattr__(s, "seen", s.w)
    run = Poisoning(s.cw, poisoned)
    dy, hinges, closures = (_counting(np.zeros(shape), SCALAR) for shape in (len(y), (len(chain.c.body), 6),
                                                                           (len(chain.cc.closure), 6)))  # fmt: skip
    state = _counting(y, SCALAR)
    run(dynamics.project)(SCALAR(0.0), state, s)  # which chooses rows
    assert run(dynamics.rhs)(SCALAR(0.0), state, dy, s, s) == fm.Status.OK
    assert run(dynamics.linearise)(SCALAR(0.0), state, s) == fm.Status.OK
    assert run(dynamics.closure_loads)(s.w, s.cc, s.cw) == fm.Status.OK
    run(dynamics.loads)(s, hinges, closures)
    return [np.array(each, float) for each in (dy, hinges, closures, state)], run.met


@pytest.mark.parametrize("algorithm", ["articulated", "composite"])
@pytest.mark.parametrize("name", ["four-bar, overconstrained", "coupled and closed", LIGHT])
def test_no_pass_within_a_kernel_reads_what_another_left(name: str, algorithm: str) -> None:
    system = fm.compile(MOVING[name]())
    start = system.initial_state
    chain = system.closures.chain(algorithm)
    expected, met = interpreted(chain, start.y, ())
    found, _ = interpreted(chain, start.y, SCRATCH)
    assert same(found, expected) and len(met) >= 7
    assert not np.isnan(np.concatenate([each.ravel() for each in found])).any()


def test_a_pass_that_reads_it_would_be_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Loads that are handed on in scratch, as they were."""
    system = fm.compile(MOVING["four-bar, overconstrained"]())
    chain, start = system.closures.chain("articulated"), system.initial_state
    handed_on = {("flexmb.closure.factor", name) for name in ("solve", "sum_rows")}
    monkeypatch.setitem(globals(), "PASSES", PASSES | handed_on)
    with pytest.raises((AssertionError, ValueError, ZeroDivisionError)):
        found, _ = interpreted(chain, start.y, SCRATCH)
        assert not np.isnan(np.concatenate([each.ravel() for each in found])).any()
