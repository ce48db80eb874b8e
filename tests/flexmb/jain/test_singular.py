"""A singular mass matrix gives no accelerations, by no algorithm; one that is nearly singular gives as many digits as
its condition leaves."""

from __future__ import annotations

import warnings
from typing import get_args

import numpy as np
import pytest

import flexmb
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from flexmb.system.algorithm import Algorithm
from flexmb.system.mechanics import Mechanics
from flexmb.system.system import System
from flexmb.tables.state import DynamicsError, PrecisionWarning, State
from tests.bounds import gamma
from tests.flexmb import extended
from tests.flexmb.jain.singular import FAMILIES, state

ALGORITHMS: tuple[Algorithm, ...] = tuple(each for each in get_args(Algorithm) if each != "frisch_as_printed")
# By order of elimination: the body whose freedom is the last of those that move the same mass; or "base", to which
# rounding of it was handed on.
AT_FAULT = {
    "two_points": {"flexible"}, "coincident_axes": {"between", "outer", "base"}, "locked_gimbal": {"inner"},
    "one_line": {"slider", "bead", "base"}, "in_all_directions": {"slider", "bead", "base"},
}  # fmt: skip
SHARES = (1e-3, 1e-6, 1e-9, 1e-11)  # conditions up to 1e13


def start(name: str, seed: int, share: float) -> tuple[System, State]:
    system = flexmb.compile(FAMILIES[name](seed, share))
    return system, state(system, share)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("name", FAMILIES)
def test_a_singular_mass_matrix_gives_no_numbers(name, seed):
    refuses(name, seed)


@pytest.mark.slow
@pytest.mark.parametrize("name", FAMILIES)
def test_a_thousand_singular_mass_matrices_give_no_numbers(name):
    for seed in range(6, 206):
        refuses(name, seed)


def refuses(name: str, seed: int) -> None:
    system, at = start(name, seed, 0.0)
    asked = [
        system.factorise, system.digits_left, *(lambda at, a=a: system.accelerations(at, a) for a in ALGORITHMS),
        *(lambda at, a=a: system.evaluate(at.t, at.q, at.u, a) for a in ALGORITHMS),
    ]  # fmt: skip
    for ask in asked:
        with pytest.raises(DynamicsError, match="is not positive definite") as error:
            ask(at)
        assert str(error.value).split('"')[1] in AT_FAULT[name]


@pytest.mark.parametrize("name", [name for name in FAMILIES if name != "locked_gimbal"])
def test_a_run_from_a_singular_mass_matrix_stops_where_it_starts(name):
    for seed in range(3):
        trajectory = flexmb.simulate(FAMILIES[name](seed, 0.0), 0.1)
        assert trajectory.status is flexmb.Status.NOT_POSITIVE_DEFINITE
        assert (trajectory.stopped_at, len(trajectory.t)) == (0.0, 0)


def test_a_singular_mass_matrix_has_no_linear_model():
    with pytest.raises(DynamicsError, match="not positive definite"):
        flexmb.linearize(*start("in_all_directions", 1, 0.0))


def test_the_families_would_pass_a_bare_test_of_signs(monkeypatch):
    """Control: without the judgement of small pivots there are numbers, and large ones."""
    monkeypatch.setattr(Mechanics, "_judge", lambda self, precision: None)
    found = []
    for seed in range(6):
        system, at = start("in_all_directions", seed, 0.0)
        try:
            found.append(np.max(np.abs(system.accelerations(at))))
        except DynamicsError:
            continue
    assert max(found) > 1e10


def test_what_was_eliminated_further_out_is_remembered():
    """Control: a pivot that is all rounding, of a body that is all rounding, looks small beside what it moved only."""
    doubted = forgotten = 0
    for seed in range(6):
        system, at = start("in_all_directions", seed, 0.0)
        doubted += refused(system, at)
        speed = system.recursion_constants.speed
        speed.flags.writeable = True
        speed["doubtful"] = 0.0
        forgotten += refused(system, at)
    assert doubted == 6 > forgotten


def refused(system: System, at: State) -> bool:
    try:
        system.accelerations(at)
    except DynamicsError:
        return True
    return False


@pytest.mark.skipif(np.finfo(float).nmant >= extended.BITS, reason="long doubles are doubles here")
@pytest.mark.filterwarnings("ignore::flexmb.tables.state.PrecisionWarning")
@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("name", FAMILIES)
def test_a_nearly_singular_mass_matrix_costs_its_condition(name, share):
    """Accelerations are right to the condition of M scaled to a unit diagonal times the rounding of a sweep."""
    for seed in range(3):
        system, at = start(name, seed, share)
        exact, M = extended.accelerations(system, at), system.mass_matrix(at)
        size = np.sqrt(np.diag(M))
        condition = np.linalg.cond(M / np.outer(size, size))
        bound = gamma(system.nu + 36 * len(system.body_names)) * condition
        for algorithm in ALGORITHMS:
            if algorithm == "frisch" and name == "two_points":
                continue  # of first order in the deformation
            error = np.linalg.norm(size * (system.accelerations(at, algorithm) - exact).astype(float))
            assert error <= bound * np.linalg.norm(size * exact.astype(float)), (algorithm, seed)


def extremes() -> dict[str, Scene]:
    ball = np.eye(3)

    def builder(name: str) -> SceneBuilder:
        return SceneBuilder(name, gravity=(0.0, 0.0, -9.81)).rigid_body(
            "inner", mass=1.0, com=(0.4, 0.1, 0.0), inertia=0.1 * ball
        ).revolute("first", "ground", "inner", rate=0.3)  # fmt: skip

    payload, giant = builder("tiny payload"), builder("giant")
    for scene, mass in ((payload, 1e-12), (giant, 1e12)):
        scene.rigid_body("outer", mass=mass, com=(0.2, 0.3, 0.1), inertia=0.1 * mass * ball)
        scene.universal("second", "inner", "outer", parent_position=(1.0, 0.2, 0.0))
    cross = builder("massless cross").rigid_body("cross", mass=0.0, inertia=0.0 * ball)
    cross.rigid_body("outer", mass=1.0, com=(0.2, 0.3, 0.1), inertia=0.1 * ball)
    cross.revolute("second", "inner", "cross", axis=(1.0, 0.0, 0.0), parent_position=(1.0, 0.2, 0.0))
    cross.revolute("third", "cross", "outer", axis=(0.0, 1.0, 0.0), angle=0.2)
    held = builder("massless on a drive").rigid_body("ghost", mass=0.0, inertia=0.0 * ball)
    held.revolute("second", "inner", "ghost", prescribed=flexmb.SpinUp(rate=1.0, duration_s=1.0))
    long = SceneBuilder("long chain", gravity=(0.0, -9.81, 0.0))
    for k in range(600):
        long.rigid_body(f"b{k}", mass=1.0, com=(0.5, 0.0, 0.0), inertia=0.1 * ball)
        long.revolute(f"h{k}", f"b{k - 1}" if k else "ground", f"b{k}", parent_position=(1.0 * (k > 0), 0.0, 0.0))
    return {each.scene().name: each.scene() for each in (payload, giant, cross, held, long)}


@pytest.mark.parametrize("scene", extremes().values(), ids=extremes())
def test_extremes_that_cost_no_digits_run_without_a_word(scene):
    """Mass ratios of 1e12, bodies without mass between hinges or on a drive, long chains: all digits but a few."""
    system = flexmb.compile(scene)
    at = system.initial_state
    with warnings.catch_warnings():
        warnings.simplefilter("error", PrecisionWarning)
        found = system.accelerations(at)
    assert system.digits_left(at) > (13.5 if "giant" not in scene.name else 3.0)
    residual = system.inverse_dynamics(at, found) - system.applied(at)
    free = system.constants.speed["prescribed"] < 0
    forces = np.abs(system.mass_matrix(at)) @ np.abs(found) + np.abs(system.bias(at))
    assert np.all(np.abs(residual[free]) <= gamma(40 * system.nu) * np.max(forces[free]))
