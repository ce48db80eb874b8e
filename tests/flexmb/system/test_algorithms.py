"""Algorithms declare themselves; systems and runs do with them what they declare, and refuse other names alike."""

from __future__ import annotations

from typing import get_args

import pytest
from typer.testing import CliRunner

import flexmb as fm
from flexmb.cli import app
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.run.warm_up import looped, pendulum, warm_up
from flexmb.system.algorithm import Algorithm
from flexmb.system.algorithms import ALGORITHMS, NESTED, ON_CHAINS, RUNNING
from flexmb.tables.state import State

NONSENSE = "nonsense"


@pytest.fixture(scope="module")
def tree() -> fm.System:
    return fm.compile(pendulum())


@pytest.fixture(scope="module")
def closed() -> fm.System:
    return fm.compile(looped())


def test_names_for_type_checkers_are_those_of_the_list():
    assert get_args(Algorithm) == tuple(ALGORITHMS)
    assert all(name == algorithm.name for name, algorithm in ALGORITHMS.items())


@pytest.mark.parametrize("name", ALGORITHMS)
def test_every_algorithm_does_what_it_declares(name, tree, closed):
    state, start = tree.initial_state, closed.initial_state
    assert tree.accelerations(state, name) == pytest.approx(tree.accelerations(state), rel=1e-12)
    assert tree.evaluate(0.0, state.q, state.u, name).loads["pivot"] == pytest.approx(
        tree.hinge_loads(state)["pivot"], rel=1e-12, abs=1e-12
    )
    for tables in (ALGORITHMS[name].own(tree), ALGORITHMS[name].fresh(tree)):
        assert ALGORITHMS[name].kernel()(0.0, state.y, *tables) == 0
        assert tables[1].speed["acceleration"] == pytest.approx(tree.accelerations(state), rel=1e-12)
    if name in RUNNING:
        assert (tree.route(name).linear is not None) == ALGORITHMS[name].jacobian
    else:
        with pytest.raises(ValueError, match=f"algorithm is '{name}': use one of 'articulated'"):
            tree.route(name)
    if name in ON_CHAINS:
        assert closed.accelerations(start, name) == pytest.approx(closed.accelerations(start), rel=1e-9, abs=1e-9)
    else:
        with pytest.raises(NotImplementedError, match='use algorithm="articulated" or "composite"'):
            closed.accelerations(start, name)
    assert (name in NESTED) == ALGORITHMS[name].is_first_order


def called_with_nonsense(tree: fm.System, closed: fm.System, state: State, start: State) -> dict[str, object]:
    """Calls by what they are given no sense for."""
    return {
        "algorithm of accelerations": lambda: tree.accelerations(state, NONSENSE),
        "algorithm of evaluate": lambda: tree.evaluate(0.0, state.q, state.u, NONSENSE),
        "algorithm of nested": lambda: tree.nested(NONSENSE),
        "algorithm of partitions": lambda: tree.partitions(state, NONSENSE),
        "algorithm of route": lambda: tree.route(NONSENSE),
        "algorithm of simulate": lambda: fm.simulate(tree, 1.0, algorithm=NONSENSE),
        "algorithm of a stiff run": lambda: fm.simulate(tree, 1.0, "radau5", algorithm=NONSENSE),
        "algorithm of warm_up": lambda: warm_up(algorithms=[NONSENSE]),
        "algorithm of a chain's accelerations": lambda: closed.accelerations(start, NONSENSE),
        "algorithm of a chain's run": lambda: fm.simulate(closed, 1.0, algorithm=NONSENSE),
        "method of simulate": lambda: fm.simulate(tree, 1.0, NONSENSE),
        "method of warm_up": lambda: warm_up(methods=[NONSENSE]),
        "elimination of a tree": lambda: fm.compile(pendulum(), elimination=NONSENSE),
        "elimination of a chain": lambda: fm.compile(looped(), elimination=NONSENSE),
        "elimination of System": lambda: fm.System(pendulum(), NONSENSE),
    }


def test_unknown_names_are_refused_in_the_same_words(tree, closed):
    calls = called_with_nonsense(tree, closed, tree.initial_state, closed.initial_state)
    said = {}
    for what, call in calls.items():
        with pytest.raises(ValueError) as refused:
            call()
        said[what] = str(refused.value)
    assert not [text for what, text in said.items() if not text.startswith(f"{what.split()[0]} is 'nonsense': use one")]


def test_the_command_line_names_what_there_is():
    said = CliRunner().invoke(app, ["simulate", "--help"], env={"COLUMNS": "300"}).output
    for name in (*INTEGRATORS, *RUNNING):
        assert name in said
