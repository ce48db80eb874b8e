"""Derivatives at one state of trees: against a complex step through the dense route, differences, and identities. What
has none, and what is refused."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import flexmb as fm
from flexmb.dense import DenseSystem
from flexmb.entry import articulated
from flexmb.entry.tangent import tangent_workspace
from tests import trees
from tests.bounds import UNIT_ROUNDOFF, algebra
from tests.flexmb.connectors.connected_scenes import everything
from tests.flexmb.entry.dual_jacobian import jacobian
from tests.flexmb.entry.test_tangent import RECIPES, H, extrapolated, terms

SCENES = {
    "every level": lambda: trees.random_scene(0, trees.EVERY_LEVEL),
    "stiffened": lambda: trees.random_scene(2, trees.STIFFENED),
    "exact": lambda: trees.random_scene(0, trees.EXACT),
    "armatures": lambda: trees.random_scene(1, trees.ARMED),
    "free-flying": lambda: trees.random_scene(3, trees.FREE_FLYING),
    "connectors": everything,
}
SMALL = {name: replace(recipe, bodies=6) for name, recipe in RECIPES.items()}
DOUBTFUL = pytest.mark.filterwarnings("ignore:.*is doubtful")


@dataclass(frozen=True)
class Asked:
    """A system at its initial state, with all derivatives there."""

    system: fm.System
    state: fm.State
    of_rates: Any
    of_all: Any

    @property
    def free(self) -> Any:
        return self.system.constants.speed["prescribed"] < 0

    def row(self, t: float, q: Any, u: Any) -> Any:
        """Everything observable; loads of drives that do not exist are zero."""
        row = np.empty(self.system.observation.width)
        self.system.observe_row(t, np.r_[q, u, 0.0], "articulated", row)
        row[self.system.observation.columns["drives"][0]][self.free] = 0.0
        return row

    def change(self, xi: Any, du: Any, dt: float) -> Any:
        """What the derivatives say of the row's change."""
        return flat(self, lambda each: each.by_displacement @ xi + each.by_speed @ du + each.by_time * dt)


@cache
def asked(name: str) -> Asked:
    system = fm.compile(SCENES[name]())
    state = system.initial_state
    return Asked(system, state, system.acceleration_derivatives(state), system.evaluation_derivatives(state))


def flat(at: Asked, of: Any) -> Any:
    """`of` each record of derivatives, in the order of a row, without the orientations of markers."""
    observation, d = at.system.observation, at.of_all
    row = np.zeros(observation.width)
    parts = observation.columns_of(row[None])
    parts["rates"][0] = of(d.accelerations)
    for i, marker in enumerate(d.markers.values()):
        parts["markers"][0, i, :3], parts["markers"][0, i, 12:18] = of(marker.position), of(marker.velocity)
        parts["markers"][0, i, 18:] = of(marker.acceleration)
    names = observation.names
    for i, name in enumerate(names.closures):
        parts["closures"][0, i] = of(d.loads[name])
    for part, group, found in (
        ("loads", names.hinges, d.loads), ("wheel_loads", names.wheels, d.wheel_loads), ("energy", d.energy, d.energy),
        ("connectors", names.connectors, d.connectors),
    ):  # fmt: skip
        for i, name in enumerate(group):
            parts[part][0, i] = of(found[name])
    for i, name in enumerate(names.hinge_forces):
        parts["hinge_forces"][0, i] = of(d.hinge_forces[name])[0]
    parts["momentum"][0] = of(d.momentum)
    for name, places in names.driven.items():
        parts["drives"][0, places] = of(d.drives[name])
    return row


def orientations(at: Asked, of: Any) -> Any:
    return np.array([of(marker.orientation) for marker in at.of_all.markers.values()])


def worst(at: Asked, found: Any, f: Any, h: float = 1e-2) -> float:
    """Largest difference of a change of a row from an extrapolated difference, in what is in doubt of the latter."""
    expected, doubt = extrapolated(f, h)
    system, M = at.system, at.system.mass_matrix(at.state)[np.ix_(at.free, at.free)]
    loss = np.linalg.cond(M, np.inf) * UNIT_ROUNDOFF / (h / 2**5)
    rows = system.observation.columns_of(np.array([found, expected, doubt, f(0.0)]))
    ratios = [0.0]
    for name, (now, wanted, unsure, value) in rows.items():
        if name == "markers":  # whose orientations are compared elsewhere
            now, wanted, unsure, value = (np.delete(x, range(3, 12), axis=1) for x in (now, wanted, unsure, value))
        size = np.max(np.abs(value), initial=1.0)
        ratios.append(float(np.max(np.abs(now - wanted) / (30.0 * unsure + loss * size), initial=0.0)))
    return max(ratios)


def directions(at: Asked, seed: int = 5) -> list[tuple[Any, Any, float]]:
    """By displacements, by speeds, by time, by all at once."""
    rng = np.random.default_rng(seed)
    nu = at.system.nu
    none, xi, du = np.zeros(nu), rng.normal(size=nu), rng.normal(size=nu)
    return [(xi, none, 0.0), (none, du, 0.0), (none, none, 1.0), (xi, du, -0.7)]


@pytest.mark.parametrize("name", SCENES)
@DOUBTFUL
def test_everything_observable_against_differences(name: str) -> None:
    at = asked(name)
    t, q, u = at.state.t, at.state.q, at.state.u
    for xi, du, dt in directions(at):
        dq = at.of_rates.motion @ xi
        found = at.change(xi, du, dt)
        row = lambda h, dq=dq, du=du, dt=dt: at.row(t + h * dt, q + h * dq, u + h * du)  # noqa: E731
        assert worst(at, found, row) <= 1.0
        if np.any(xi):
            assert worst(at, found * (1.0 + 1e-5), row) > 1.0, "a planted error of a hundred-thousandth"


@pytest.mark.parametrize("name", ["every level", "free-flying"])
@DOUBTFUL
def test_orientations_of_markers_are_small_rotations(name: str) -> None:
    at = asked(name)
    system, q, u = at.system, at.state.q, at.state.u
    xi = directions(at)[0][0]
    rotations = lambda h: np.array([  # noqa: E731
        marker.rotation for marker in system.evaluate(0.0, q + h * at.of_rates.motion @ xi, u).markers.values()
    ])  # fmt: skip
    expected, doubt = extrapolated(rotations, 1e-2)
    turn = orientations(at, lambda each: each.by_displacement @ xi)
    found = np.cross(turn[:, None, :], np.swapaxes(rotations(0.0), 1, 2)).swapaxes(1, 2)
    assert np.max(np.abs(found - expected)) <= 30.0 * np.max(doubt) + 1e-11


@pytest.mark.parametrize(("recipe", "seed"), [(name, seed) for name in SMALL for seed in (0, 1)])
@DOUBTFUL
def test_inverse_dynamics_against_the_dense_route(recipe: str, seed: int) -> None:
    """Mass matrix and bias of another code, differentiated by themselves along random displacements and speeds."""
    scene = trees.random_scene(seed, SMALL[recipe])
    system, dense = fm.compile(scene), DenseSystem(scene)
    state, rng = system.initial_state, np.random.default_rng(seed)
    rates = rng.normal(size=system.nu)
    d = system.inverse_dynamics_derivatives(state, rates)
    bound = algebra(dense.nu, len(dense.tree.members), max(len(member.model.mass) for member in dense.tree.members))
    free = system.constants.speed["prescribed"] < 0
    for by_displacement in (True, False):
        change = rng.normal(size=system.nu) * free
        q = state.q + (1j * H * (d.motion @ change) if by_displacement else 0.0)
        u = state.u + (0.0 if by_displacement else 1j * H * change)
        inertial, bias = dense.mass_matrix(q) @ rates, dense.bias(q, u)
        expected = np.imag(inertial + bias) / H
        columns = d.by_displacement if by_displacement else d.by_speed
        M = dense.mass_matrix(state.q)
        parts = np.imag(inertial) / H, np.imag(bias) / H, d.tau, M @ np.abs(rates)
        size = max(np.max(np.abs(part)) for part in parts)
        assert np.max(np.abs(columns @ change - expected)) <= bound * size
        assert np.max(np.abs(columns @ change * (1.0 + 1e-9) - expected)) > bound * size, "a planted error"
    M = dense.mass_matrix(state.q)
    np.testing.assert_allclose(d.by_acceleration, M, rtol=0.0, atol=bound * np.max(np.abs(M)))
    np.testing.assert_array_equal(d.tau, system.inverse_dynamics(state, rates))


@pytest.mark.parametrize(("recipe", "seed"), [("rigid", 2), ("full", 3), ("ruthless", 1), ("mixed", 2)])
@DOUBTFUL
def test_accelerations_against_the_dense_route(recipe: str, seed: int) -> None:
    """M dudot + d(M udot + c - tau) = 0 along random directions, and the response to forces is the inverse of M."""
    scene = trees.random_scene(seed, SMALL[recipe])
    system, dense = fm.compile(scene), DenseSystem(scene)
    state, rng, free = system.initial_state, np.random.default_rng(seed), system.constants.speed["prescribed"] < 0
    d, M = system.acceleration_derivatives(state), dense.mass_matrix(state.q)
    bound = algebra(dense.nu, len(dense.tree.members), max(len(member.model.mass) for member in dense.tree.members))
    for _ in range(3):
        xi, du = rng.normal(size=(2, system.nu)) * free
        q, u = state.q + 1j * H * (d.motion @ xi), state.u + 1j * H * du
        parts = [np.imag(part) / H for part in terms(dense, q, u, d.accelerations)]
        x = d.by_displacement @ xi + d.by_speed @ du
        size = np.linalg.norm(M, np.inf) * np.max(np.abs(x)) + sum(np.max(np.abs(part)) for part in parts)
        assert np.max(np.abs((M @ x + sum(parts))[free])) <= bound * size
        assert np.max(np.abs((M @ (x * (1.0 + 1e-9)) + sum(parts))[free])) > bound * size, "a planted error"
    held = np.where(free, 1.0, 0.0)
    assert not (d.by_force * (1.0 - held)).any() and not (d.by_force.T * (1.0 - held)).any()
    identity = M[np.ix_(free, free)] @ d.by_force[np.ix_(free, free)]
    size = np.linalg.norm(M, np.inf) * np.linalg.norm(d.by_force, np.inf)
    np.testing.assert_allclose(identity, np.eye(np.sum(free)), rtol=0.0, atol=bound * size)
    size = np.max(np.abs(d.by_displacement))
    np.testing.assert_allclose(d.by_coordinates @ d.motion, d.by_displacement, rtol=0.0, atol=1e-14 * size)


@pytest.mark.parametrize("name", SCENES)
@DOUBTFUL
def test_accelerations_against_the_directions_of_duals(name: str) -> None:
    """The other route pushes each direction through the whole recursion: by raw coordinates, and by speeds."""
    at = asked(name)
    system, y, nq = at.system, at.state.y.copy(), at.system.nq
    J, w = np.empty((len(y), len(y))), tangent_workspace(system.constants, nq, system.nu)
    assert jacobian(at.state.t, y, J, system.constants, w) == fm.Status.OK
    by_q, by_u, N = J[nq:-1, :nq], J[nq:-1, nq:-1], J[:nq, nq:-1]
    d = at.of_rates
    pairs = (d.by_coordinates, by_q), (d.by_speed, by_u), (d.motion, N), (d.by_displacement, by_q @ N)
    for found, other in pairs:
        assert np.max(np.abs(found - other)) <= 1e-11 * np.max(np.abs(other))


@pytest.mark.parametrize(("recipe", "seed"), [(name, seed) for name in SMALL for seed in (0, 3)])
@DOUBTFUL
def test_observed_quantities_against_the_dense_route(recipe: str, seed: int) -> None:
    """Loads, markers and momentum of given accelerations, by a complex step through the other code."""
    scene = trees.random_scene(seed, replace(SMALL[recipe], prescribed=False))
    system, dense = fm.compile(scene), DenseSystem(scene)
    state, rng = system.initial_state, np.random.default_rng(seed)
    rates = rng.normal(size=system.nu)
    d, motion = system.evaluation_derivatives(state, rates), system.acceleration_derivatives(state).motion
    bound = algebra(dense.nu, len(dense.tree.members), max(len(member.model.mass) for member in dense.tree.members))

    def observed(q: Any, u: Any, rates: Any) -> dict[str, Any]:
        markers = {
            name: np.concatenate([marker.position, marker.velocity, marker.acceleration])
            for name, marker in dense.markers(0.0, q, u, rates).items()
        }
        loads = dense.hinge_loads(0.0, q, u, rates) | dense.wheel_loads(0.0, q, u, rates)
        return {**markers, **loads, "momentum": dense.momentum(q, u)}

    for kind in ("by_displacement", "by_speed", "by_acceleration"):
        change = rng.normal(size=system.nu)
        step = {"by_displacement": motion @ change}.get(kind, change) * 1j * H
        q, u = state.q + (step if kind == "by_displacement" else 0.0), state.u + (step if kind == "by_speed" else 0.0)
        expected = observed(q, u, rates + (step if kind == "by_acceleration" else 0.0))
        markers = {
            name: np.concatenate(
                [getattr(part, kind) for part in (marker.position, marker.velocity, marker.acceleration)]
            )
            for name, marker in d.markers.items()
        }
        found = {**markers, **{name: getattr(each, kind) for name, each in {**d.loads, **d.wheel_loads}.items()}}
        found["momentum"] = getattr(d.momentum, kind)
        size = max(np.max(np.abs(value)) + np.max(np.abs(np.imag(value))) / H for value in expected.values())
        size += max(np.max(np.abs(each)) for each in found.values()) * np.max(np.abs(change))
        misses = [np.max(np.abs(found[name] @ change - np.imag(value) / H)) for name, value in expected.items()]
        planted = [np.max(np.abs(found[name] @ change * (1.0 + 1e-8) - np.imag(value) / H))
                   for name, value in expected.items()]  # fmt: skip
        assert max(misses) <= bound * size
        assert max(planted) > bound * size, "a planted error of a hundred-millionth"


@pytest.mark.parametrize("name", SCENES)
@DOUBTFUL
def test_rates_along_the_motion(name: str) -> None:
    """A marker's position changes by its velocity, and its velocity by its acceleration."""
    at = asked(name)
    system, state, d = at.system, at.state, at.of_all
    evaluated = system.evaluate(state.t, state.q, state.u)
    scale = max((np.max(np.abs(marker.acceleration)) for marker in evaluated.markers.values()), default=1.0)
    u, udot = state.u, at.of_rates.accelerations
    for name, motion in evaluated.markers.items():
        found = d.markers[name]
        moving = found.position.by_displacement @ u + found.position.by_time
        turning = found.orientation.by_displacement @ u + found.orientation.by_time
        np.testing.assert_allclose(np.r_[turning, moving], motion.velocity, rtol=0.0, atol=1e-12 * scale)
        speeding = found.velocity.by_displacement @ u + found.velocity.by_speed @ udot + found.velocity.by_time
        np.testing.assert_allclose(speeding, motion.acceleration, rtol=0.0, atol=1e-11 * scale)


@pytest.mark.parametrize("name", ["stiffened", "free-flying", "connectors"])
@DOUBTFUL
def test_energy_changes_by_the_power(name: str) -> None:
    """Of what has no potential. (Levels ruthless and linear leave terms out, so that their balance does not close.)"""
    at = asked(name)
    system, state, d = at.system, at.state, at.of_all
    u, udot = state.u, at.of_rates.accelerations
    y, dy = state.y.copy(), np.empty(len(state.y))
    articulated.rhs(state.t, y, dy, system.constants, system.workspace())
    each = [by.by_displacement @ u + by.by_speed @ udot + by.by_time for by in d.energy.values()]
    size = max(np.max(np.abs(by.by_speed) @ np.abs(udot)) for by in d.energy.values()) + abs(dy[-1])
    assert abs(sum(each) - dy[-1]) <= 1e-11 * max(1.0, float(size))


@DOUBTFUL
def test_momentum_changes_by_the_loads_from_outside() -> None:
    """Of a scene in free flight not at all; of one on the ground by its hinges there and its weight."""
    flying, grounded = asked("free-flying"), standing()
    for at in (flying, grounded):
        rate = at.of_all.momentum.by_displacement @ at.state.u + at.of_all.momentum.by_time
        rate += at.of_all.momentum.by_speed @ at.of_rates.accelerations
        evaluated, system = at.system.evaluate(0.0, at.state.q, at.state.u), at.system
        on_ground = [h.name for h in system.scene.hinges if h.parent == "ground"] if at is grounded else []
        force = sum((evaluated.loads[name][3:] for name in on_ground), start=np.zeros(3))
        mass = system.mass_properties(at.state).mass
        force += mass * system.constants.gravity
        size = mass * np.max(np.abs(at.of_rates.accelerations))
        np.testing.assert_allclose(rate[3:], force, rtol=0.0, atol=1e-11 * size)
        if at is flying:
            assert np.max(np.abs(rate)) <= 1e-11 * size


def standing() -> Asked:
    system = fm.compile(trees.random_scene(4, replace(trees.CONSERVATIVE, levels=("full", "rigid"), point_masses=0)))
    state = system.initial_state
    return Asked(system, state, system.acceleration_derivatives(state), system.evaluation_derivatives(state))


@pytest.mark.parametrize("name", ["every level", "connectors"])
@DOUBTFUL
def test_forces_as_motors_exert_them(name: str) -> None:
    """A generalised force changes accelerations by M^-1, and the loads as inverse dynamics says; drives relieve it."""
    at = asked(name)
    system, nu = at.system, at.system.nu
    tau = np.random.default_rng(2).normal(size=nu)
    push = at.of_all.accelerations.by_force @ tau
    np.testing.assert_array_equal(at.of_all.accelerations.by_force, at.of_rates.by_force)
    start, step = at.of_rates.accelerations, 2.0**20
    near, far = (system.hinge_loads(at.state, start + x * push) for x in (0.0, step))
    size = max(np.max(np.abs(each)) for each in far.values()) / step
    for hinge in near:
        found = at.of_all.loads[hinge].by_force @ tau
        np.testing.assert_allclose(found, (far[hinge] - near[hinge]) / step, rtol=0.0, atol=1e-10 * size)
    M, driven = system.mass_matrix(at.state), ~at.free
    drives = np.zeros(nu)
    for hinge, places in system.observation.names.driven.items():
        drives[places] = at.of_all.drives[hinge].by_force @ tau
    np.testing.assert_allclose(drives[driven], (M @ push - tau)[driven], rtol=0.0, atol=1e-10 * max(size, 1.0))
    for by in at.of_all.energy.values():
        assert not by.by_force.any()


def pushed(torque: float, *, closed: bool = False) -> fm.System:
    """A flexible arm and a swinging bar, with a motor; closed to a loop by a spherical closure."""
    scene = fm.SceneBuilder("pushed", gravity=(0.3, -9.81, 0.5))
    section = fm.scene.shapes.beam_section(E=2e9, G=8e8, A=6e-4, Iy=8e-8, Iz=5e-8, rho=1500.0)
    scene.beam("rod", length=0.8, elements=4, section=section, modes=2)
    scene.rigid_body("bar", mass=0.8, com=(0.2, 0.01, 0.0), inertia=(0.02, 0.03, 0.025))
    scene.revolute("root", "ground", "rod", axis=(0, 0.6, 0.8), angle=0.4, rate=0.8, torque=fm.Constant(value=torque))
    scene.spherical("ball", "rod", "bar", parent_node="tip", quaternion=(0.8, 0.36, -0.48, 0.0),
                    angular_velocity=(0.4, -0.7, 0.5))  # fmt: skip
    if closed:
        scene.prismatic("slide", "ground", "post", axis=(1, 0, 0))
        scene.rigid_body("post", mass=0.5, inertia=(0.01, 0.01, 0.01))
        scene.closure("end", "universal", "bar", "post", position_a=(0.5, 0, 0), position_b=(0.9, 0.2, 0.1))
    return fm.compile(scene.scene())


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
@DOUBTFUL
def test_further_forces_are_as_those_of_a_motor(closed: bool) -> None:
    torque = 35.0
    without, motor = pushed(0.0, closed=closed), pushed(torque, closed=closed)
    state = without.initial_state
    forces = np.zeros(without.nu)
    forces[without.speed("root")] = torque
    found = without.acceleration_derivatives(state, forces)
    expected = motor.acceleration_derivatives(motor.state(state.q, state.u))
    plain = without.acceleration_derivatives(state)
    for name in (*(field.name for field in fields(found)), "by_coordinates"):
        one, other = getattr(found, name), getattr(expected, name)
        size = np.max(np.abs(other), initial=1.0)
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-11 * size, err_msg=name)
    assert np.max(np.abs(plain.by_displacement - found.by_displacement)) > 1e-4 * np.max(np.abs(found.by_displacement))
    with pytest.raises(ValueError, match="forces"):
        without.acceleration_derivatives(state, np.full(without.nu, np.nan))


@DOUBTFUL
def test_prescribed_columns_vanish() -> None:
    at = asked("every level")
    held = ~at.free
    assert held.any()
    for each in (at.of_rates.by_displacement, at.of_rates.by_speed, at.of_rates.by_force):
        assert not each[:, held].any() and not each[held].any()
    for name in at.of_all.loads:
        assert not at.of_all.loads[name].by_speed[:, held].any()
    assert at.of_rates.by_time.any() and at.of_all.loads["h3"].by_time.any()


REQUIRED = 1e-11  # relative, of accelerations; the worst of 500 trees was off by 4e-12, of inverse dynamics by 7e-15


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 125))
@pytest.mark.parametrize("recipe", RECIPES)
def test_a_random_tree(recipe: str, seed: int) -> None:
    scene = trees.random_scene(seed, replace(RECIPES[recipe], bodies=6))
    system, dense, rng = fm.compile(scene), DenseSystem(scene), np.random.default_rng(seed)
    state, free = system.initial_state, system.constants.speed["prescribed"] < 0
    rates = rng.normal(size=system.nu)
    of_rates, of_tau = system.acceleration_derivatives(state), system.inverse_dynamics_derivatives(state, rates)
    xi, du = rng.normal(size=(2, system.nu)) * free
    q, u = state.q + 1j * H * (of_rates.motion @ xi), state.u + 1j * H * du
    missing = sum(np.imag(part) / H for part in terms(dense, q, u, of_rates.accelerations))
    expected = -np.linalg.solve(dense.mass_matrix(state.q)[np.ix_(free, free)], missing[free])
    found = (of_rates.by_displacement @ xi + of_rates.by_speed @ du)[free]
    assert np.max(np.abs(found - expected)) <= REQUIRED * np.max(np.abs(expected))
    expected = np.imag(dense.mass_matrix(q) @ rates + dense.bias(q, u)) / H
    found = of_tau.by_displacement @ xi + of_tau.by_speed @ du
    assert np.max(np.abs(found - expected)) <= REQUIRED * np.max(np.abs(expected))


def with_stop(angle: float) -> fm.System:
    scene = fm.SceneBuilder("stopped", gravity=(0.0, -9.81, 0.0))
    scene.rigid_body("arm", mass=1.0, com=(0.5, 0.0, 0.0), inertia=(0.1, 0.1, 0.1))
    scene.revolute("pivot", "ground", "arm", angle=angle)
    scene.angular_spring("stop", "pivot", upper=0.5, stop_stiffness=100.0)
    return fm.compile(scene.scene())


def with_cable(length: float) -> fm.System:
    scene = fm.SceneBuilder("tethered", gravity=(0.0, 0.0, 0.0))
    scene.rigid_body("bob", mass=1.0, inertia=(0.1, 0.1, 0.1))
    scene.prismatic("slide", "ground", "bob", axis=(1.0, 0.0, 0.0), position=length)
    scene.spring_damper("cable", "ground", "bob", free_length=0.4, stiffness=50.0, acts="tension")
    return fm.compile(scene.scene())


BY_MASS = {
    "accelerations": lambda by, state: by.accelerations(state),
    "slopes": lambda by, state: by.slopes(0.0, state.y, np.zeros((3, 1))),
    "evaluate": lambda by, state: by.evaluate(state),
    "inverse_dynamics": lambda by, state: by.inverse_dynamics(state, np.zeros(1)),
}


@pytest.mark.parametrize("door", BY_MASS)
@pytest.mark.parametrize(("make", "at"), [(with_stop, 0.5), (with_cable, 0.4)])
def test_derivatives_by_parameters_refuse_a_corner(door, make, at) -> None:
    """Just at the stop or just slack; a millionth beside it derivatives exist. Of all public calls: test_corners."""
    system = make(at)
    by = system.parameters([f"{system.body_names[0]}.mass_kg"])
    with pytest.raises(fm.NotDifferentiableError, match='connector "(stop|cable)" has no derivative'):
        BY_MASS[door](by, system.initial_state)
    beside = make(at + 1e-6)
    BY_MASS[door](beside.parameters([f"{beside.body_names[0]}.mass_kg"]), beside.initial_state)


def test_derivatives_differ_beside_a_corner() -> None:
    """On either side of them derivatives exist, and differ."""
    for make, at, step, slope in ((with_stop, 0.5, 0.1, -100.0 / 0.35), (with_cable, 0.4, 0.1, -50.0)):
        before, after = (make(at + side * step) for side in (-1, 1))
        one, other = (each.acceleration_derivatives(each.initial_state).by_displacement for each in (before, after))
        gravity = 9.81 * 0.5 / 0.35 if make is with_stop else 0.0
        np.testing.assert_allclose(one, gravity * np.sin(at - step), atol=1e-9)
        np.testing.assert_allclose(other, gravity * np.sin(at + step) + slope, rtol=1e-6)


def test_friction_at_rest_is_smooth() -> None:
    """Its derivative is finite there: -level / smoothing / I."""
    scene = fm.SceneBuilder("rubbing")
    scene.rigid_body("disc", mass=1.0, inertia=(0.1, 0.1, 0.1)).revolute("pivot", "ground", "disc")
    scene.angular_friction("bearing", "pivot", sliding=0.3, smoothing=0.02)
    system = fm.compile(scene.scene())
    d = system.acceleration_derivatives(system.initial_state)
    np.testing.assert_allclose(d.by_speed, -0.3 / 0.02 / 0.1, rtol=1e-12)


def test_controllers_are_refused_with_the_remedy() -> None:
    from tests.flexmb.system.test_copies import controlled

    system = fm.compile(controlled())
    state = system.initial_state
    evaluator = lambda _: system.derivative_evaluator()  # noqa: E731
    for ask in (system.acceleration_derivatives, system.evaluation_derivatives, evaluator):
        with pytest.raises(NotImplementedError, match=r"has controllers.*open_loop.*ControlledMotion"):
            ask(state)
    opened = fm.compile(fm.open_loop(controlled()))
    assert np.isfinite(opened.acceleration_derivatives(opened.initial_state).by_displacement).all()


def test_a_scene_without_freedom() -> None:
    scene = fm.SceneBuilder("still").rigid_body("block", mass=1.0, inertia=(0.1, 0.1, 0.1)).weld("w", "ground", "block")
    system = fm.compile(scene.scene())
    d = system.evaluation_derivatives(system.initial_state)
    assert d.loads["w"].by_speed.shape == (6, 0) and not d.loads["w"].by_time.any()
    rates = system.acceleration_derivatives(system.initial_state)
    assert {getattr(rates, field.name).size for field in fields(rates)} == {0}
