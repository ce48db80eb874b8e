"""Energy and momentum along the motion: their exact rates are the power and the wrench of what acts from outside.

The derivative of E(t, q, u) along the flow is that along the straight line (t + s, q + s qdot, u + s udot) at s = 0,
taken by collocation with a known bound of its round-off. Nothing is integrated.
"""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest

import flexmb
from flexmb.dense import DenseSystem
from flexmb.dense.jets import profile
from flexmb.scene import schema as s
from flexmb.system.observables import Evaluation
from flexmb.system.system import System
from tests import trees
from tests.bounds import algebra, observed_order
from tests.flexmb import spectral
from tests.unlocked import unlocked

SMALL = replace(trees.FULL, bodies=5)
RECIPES = {
    "rigid": replace(trees.RIGID, bodies=8), "full": SMALL, "full and rigid": replace(SMALL, levels=("full", "rigid")),
}  # fmt: skip
CASES = [(name, seed) for name in RECIPES for seed in (21, 24)]  # no spherical spring near its cusp at half a turn
SPAN = 0.02  # s; five hinges in a row turn by some 10 rad/s
START = 0.3  # s; after it all profiles move


class Line:
    """The straight line in (t, q, u) that touches the motion at its initial state."""

    def __init__(self, scene: s.Scene) -> None:
        self.scene, self.system = scene, flexmb.compile(scene)
        self.state = self.system.initial_state
        y = np.concatenate([self.state.q, self.state.u, [0.0]])
        self.system.project(START, y, self.system.constants)
        dy = np.zeros_like(y)
        assert self.system.rhs(START, y, dy, self.system.constants, self.system.workspace()) == 0
        self._y, self._dy = y, dy
        self.power = dy[-1]
        self.seen = [self.at(x) for x in spectral.times(SPAN)]

    def at(self, x: float, system: System | None = None) -> Evaluation:
        y, nq = self._y + x * self._dy, self.system.nq
        return (system or self.system).evaluate(START + x, y[:nq], y[nq:-1])

    @property
    def now(self) -> Evaluation:
        return self.seen[spectral.MIDDLE]

    @property
    def digits(self) -> float:
        return algebra(self.system.nu, len(self.system.body_names), 15)


@pytest.fixture(scope="module", params=CASES, ids=str)
def line(request) -> Line:
    name, seed = request.param
    return Line(observable(trees.random_scene(seed, RECIPES[name])))


def observable(scene: s.Scene) -> s.Scene:
    """With markers "out <hinge>" at the outboard hinge points and "at <load>" where loads act."""
    out = [
        s.Marker(name=f"out {h.name}", body=h.child, node=h.child_node, offset_m=h.child_position_m)
        for h in scene.hinges
    ]
    at = [s.Marker(name=f"at {load.name}", body=load.body, node=load.node) for load in scene.loads]
    return msgspec.structs.replace(scene, markers=(*scene.markers, *out, *at))


def test_energy_changes_by_the_power(line):
    """dE/dt = motors + dampers + drives + loads + modal damping."""
    kinds = np.array([list(e.energy.values()) for e in line.seen])
    rate = spectral.at_zero(kinds.sum(axis=1), SPAN)[0]
    # kinetic energy sums terms of both signs, no larger than those of 1/2 |u|' |M| |u|
    terms = np.sum(np.abs(kinds), axis=1).max()
    assert abs(line.power) > 1e-3, "nothing drives this scene: it would show nothing"
    assert abs(rate - line.power) <= spectral.rounding(SPAN, 1, 10.0 * terms, line.digits)


def test_momentum_changes_by_the_wrench_from_outside(line):
    """d/dt [h; p] about the World origin = loads of the hinges to the ground + gravity + loads at nodes."""
    momenta = np.array([e.momentum for e in line.seen])
    rate = spectral.at_zero(momenta, SPAN)[0]
    wrench, size = np.zeros(6), np.max(np.abs(momenta))
    for hinge in line.scene.hinges:
        if hinge.parent == "ground":
            wrench += about_origin(line.now.loads[hinge.name], line.now.markers[f"out {hinge.name}"].position)
    for load in line.scene.loads:
        wrench += about_origin(node_load(line, load), line.now.markers[f"at {load.name}"].position)
    gravity = np.array(line.scene.gravity_m_s2)
    wrench += np.concatenate([np.cross(first_moment(line), gravity), total_mass(line) * gravity])
    rounding = 6.0 * line.digits * forces(line) * (1.0 + largest_arm(line))  # six loads at most, moved to the origin
    assert np.max(np.abs(rate - wrench)) <= spectral.rounding(SPAN, 1, 10.0 * size, line.digits) + rounding


def forces(line: Line) -> float:
    """Size of the generalised forces before they cancel."""
    M, c = line.system.mass_matrix(line.state), line.system.bias(line.state)
    return float(np.max(np.abs(M) @ np.abs(line.now.accelerations) + np.abs(c)))


def largest_arm(line: Line) -> float:
    return max(float(np.max(np.abs(marker.position))) for marker in line.now.markers.values())


def about_origin(load: np.ndarray, position: np.ndarray) -> np.ndarray:
    return np.append(load[:3] + np.cross(position, load[3:]), load[3:])


def node_load(line: Line, load: s.Load) -> np.ndarray:
    """[torque; force] in World axes at START, by the dense route's profiles."""
    vector = float(profile(load.function, START).value) * np.array(load.direction)
    if load.frame == "node":
        vector = line.now.markers[f"at {load.name}"].rotation @ vector
    return np.append(vector, np.zeros(3)) if load.type == "torque" else np.append(np.zeros(3), vector)


def first_moment(line: Line) -> np.ndarray:
    """sum m r (3,): minus the gravity energy of unit gravities."""
    found = []
    for axis in np.eye(3):
        unit = flexmb.compile(msgspec.structs.replace(line.scene, gravity_m_s2=tuple(map(float, axis))))
        found.append(-line.at(0.0, unit).energy["gravity"])
    return np.array(found)


def total_mass(line: Line) -> float:
    """The linear momentum that a common velocity would have: bodies, wheels and point masses, from the scene."""
    return float(np.sum(DenseSystem(line.scene).points.mass))


def test_velocities_of_markers_are_rates_of_their_positions(line):
    for name, marker in line.now.markers.items():
        positions = np.array([e.markers[name].position for e in line.seen])
        velocities = np.array([e.markers[name].velocity for e in line.seen])
        size = 1.0 + np.max(np.abs(positions))
        first = spectral.at_zero(positions, SPAN)[0]
        assert np.max(np.abs(first - marker.velocity[3:])) <= spectral.rounding(SPAN, 1, size, line.digits)
        second = spectral.at_zero(velocities, SPAN)[0]
        size = 1.0 + np.max(np.abs(velocities))
        assert np.max(np.abs(second - marker.acceleration)) <= spectral.rounding(SPAN, 1, 10.0 * size, line.digits)


def test_a_scene_without_losses_has_no_power():
    line = Line(trees.random_scene(22, replace(trees.CONSERVATIVE, bodies=4)))
    assert line.power == 0.0


def _unsymmetric_inertia(system: System) -> None:
    c = unlocked(system.constants)
    c.product[0, :, 2] *= 30.0  # P1_n1


def _unsymmetric_stiffness(system: System) -> None:
    unlocked(system.constants).stiffness[:, 0, 1] *= 30.0


@pytest.mark.parametrize("tamper", [_unsymmetric_inertia, _unsymmetric_stiffness])
def test_a_force_that_belongs_to_no_energy_is_noticed(tamper):
    system = flexmb.compile(trees.random_scene(23, replace(trees.FULL, bodies=4)))
    bound, honest = power_defect(system)
    assert abs(honest) <= bound
    tamper(system)
    assert abs(power_defect(system)[1]) > 100.0 * bound


ORDERS = {"ruthless": (trees.RUTHLESS, 1.0), "linear": (trees.LINEAR, 2.0)}


@pytest.mark.parametrize(("recipe", "order"), ORDERS.values(), ids=ORDERS.keys())
def test_truncated_levels_do_not_conserve_energy(recipe, order):
    """Their bias is not derived from their kinetic energy: the balance fails, by the order that was dropped."""
    sizes = np.logspace(-1, -3, 5)
    systems = [flexmb.compile(trees.random_scene(26, replace(recipe, bodies=4, deformation=x))) for x in sizes]
    bounds, defects = np.abs([power_defect(system) for system in systems]).T
    assert observed_order(sizes, defects, floor=np.max(bounds), last=3) == pytest.approx(order, abs=0.1)


def power_defect(system: System) -> tuple[float, float]:
    """Bound of the round-off, and dE/dt minus the power."""
    y = np.concatenate([system.initial_state.q, system.initial_state.u, [0.0]])
    dy = np.zeros_like(y)
    assert system.rhs(0.0, y, dy, system.constants, system.workspace()) == 0
    lines = [y + x * dy for x in spectral.times(SPAN)]
    kinds = np.array(
        [
            list(system.evaluate(x, z[: system.nq], z[system.nq : -1]).energy.values())
            for x, z in zip(spectral.times(SPAN), lines, strict=True)
        ]
    )
    digits = algebra(system.nu, len(system.body_names), 15)
    bound = spectral.rounding(SPAN, 1, 10.0 * np.sum(np.abs(kinds), axis=1).max(), digits)
    return bound, float(spectral.at_zero(kinds.sum(axis=1), SPAN)[0] - dy[-1])
