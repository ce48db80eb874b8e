"""A hinge with a single axis takes a path of its own: to the same numbers, and two files know of it."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flexmb
from flexmb.entry import articulated, factorisation
from flexmb.jain.response import response
from flexmb.tables.arrays import ANGULAR_Z, LINEAR_Z, NO_AXIS, Constants
from flexmb.tables.status import OK
from flexmb.typing import Real
from tests.bounds import gamma
from tests.flexmb.jain.random_states import RandomState, random_state


@pytest.fixture(scope="module", params=["rigid", "full"])
def found(request) -> RandomState:
    """A tree with hinges of several kinds, many with a single axis."""
    state = random_state(3, request.param, 20)
    assert {ANGULAR_Z, LINEAR_Z, NO_AXIS} <= set(state.system.constants.body["axis"].tolist())
    return state


def without_axes(c: Constants) -> Constants:
    """The same tree, every hinge a general one."""
    body = c.body.copy()
    body["axis"] = NO_AXIS
    return replace(c, body=body)


def test_the_axis_is_the_one_motion_of_the_hinge(found):
    """Column 0 of H, as the hinge's own file has it, has a one in the row `axis`, and nothing else."""
    c, w = without_axes(found.system.constants), found.system.workspace()
    assert articulated.accelerations(0.0, start(found), c, w) == OK
    for body, state in zip(found.system.constants.body, w.hinge, strict=True):
        assert (body["axis"] >= 0) == (body["nv"] == 1)
        if body["nv"] == 1:
            assert np.flatnonzero(state["map"][:, 0]).tolist() == [body["axis"]]


def test_small_matrices_give_the_same_accelerations(found):
    c = found.system.constants
    one, several = (accelerations(found, each) for each in (c, without_axes(c)))
    residual = found.M @ (one - several)
    assert np.max(np.abs(residual)) <= bound(found, one)


def test_small_matrices_give_the_same_solutions(found):
    """The factor itself, both products with it and the solution."""
    c = found.system.constants
    for apply in (factorisation.half_solve, factorisation.half_multiply, factorisation.multiply, factorisation.solve):
        one, several = (applied(found, each, apply) for each in (c, without_axes(c)))
        assert np.max(np.abs(one - several)) <= gamma(found.system.nu) * np.linalg.cond(found.M) * np.max(np.abs(one))


def test_two_files_know_of_it():
    """Elsewhere neither its mark nor the axis: the recursion asks a hinge for what it does."""
    named = re.compile(r"\b(SINGLE|ANGULAR_Z|LINEAR_Z|REVOLUTE|PRISMATIC)\b|free_count == -1\b|body\[k\]\.axis\b")
    assert named.search("if w.body[k].free_count == SINGLE:")
    packages = Path(flexmb.__file__).parent
    rooms = [path for room in ("jain", "closure", "entry") for path in (packages / room).glob("*.py")]
    knowing = [path.name for path in rooms if named.search(path.read_text(encoding="utf-8"))]
    assert sorted(knowing) == ["axis.py", "hinge_solve.py"]


def start(found: RandomState) -> Real:
    return np.concatenate([found.state.q, found.state.u, [0.0]])


def accelerations(found: RandomState, c: Constants) -> Real:
    w = found.system.workspace()
    assert articulated.accelerations(found.state.t, start(found), c, w) == OK
    return w.speed["acceleration"].copy()


def applied(found: RandomState, c: Constants, apply) -> Real:
    w, b = found.system.workspace(), np.random.default_rng(1).normal(size=(1, found.system.nu))
    assert factorisation.factorise(found.state.t, start(found), c, c, w) == OK
    apply(c, w, response(c), b)
    return b[0]


def bound(found: RandomState, rates: Real) -> float:
    return float(found.bound * np.max(np.abs(found.M) @ np.abs(rates)))
