"""Connectors in closed chains, on beams taken apart, in batches and in equilibria."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb as fm
from flexmb.dense import DenseSystem
from flexmb.surrogate import finite_segments
from tests.flexmb.connectors.connected_scenes import between_bodies, bodies, free_flying
from tests.flexmb.surrogate.beams import beam_scene

BAR = {"mass": 1.0, "com": (0.5, 0, 0), "inertia": (0.002, 0.09, 0.09), "nodes": {"tip": (1.0, 0, 0)}}


def four_bar() -> fm.SceneBuilder:
    """A parallelogram of bars of one metre in a vertical plane, two of them hinged to the ground."""
    builder = fm.SceneBuilder("sprung loop", gravity=(0, 0, -9.81))
    for name in ("left", "coupler", "right"):
        builder.rigid_body(name, **BAR)
    upright = {"axis": (0, 1, 0), "angle": -1.2}
    builder.revolute("a", "ground", "left", **upright)
    builder.revolute("b", "left", "coupler", axis=(0, 1, 0), angle=1.2, parent_node="tip")
    builder.revolute("c", "ground", "right", parent_position=(1, 0, 0), **upright)
    return builder.closure("d", "spherical", "coupler", "right", node_a="tip", node_b="tip")


@pytest.mark.parametrize("algorithm", ["articulated", "composite"])
def test_in_a_closed_chain_energy_stays(algorithm):
    """A diagonal spring that swings the loop to and fro; without it the loop would fall."""
    scene = four_bar().spring_damper(
        "diagonal", "ground", "coupler", node_b="tip", free_length=1.2, stiffness=60.0, damping=0.5
    ).angular_spring("coil", "a", rest=-1.0, stiffness=2.0, stiffening=(0.0, 3.0)).scene()  # fmt: skip
    run = fm.simulate(scene, 1.0, algorithm=algorithm, method="dop853", rtol=1e-10, atol=1e-12, samples=21)
    assert run.finished and np.ptp(run.energy["spring"]) > 1.0 and run.work[-1] < -0.01
    assert np.max(np.abs(run.energy_drift)) <= 1e-8 * run.energy_scale


def test_a_beam_taken_apart_keeps_its_springs():
    """What was fixed to the beam's tip is fixed to the last piece: the same load at the same place."""
    scene = beam_scene()
    beam = scene.bodies[0]
    whole = fm.SceneBuilder("whole", gravity=scene.gravity_m_s2).add(*scene.bodies, *scene.hinges).add(*scene.markers)
    stayed = {"node_b": "tip", "position_a": (0, 1, 1), "free_length": 0.5, "stiffness": 30.0}
    whole.spring_damper("stay", "ground", beam.name, **stayed)
    apart = finite_segments(whole.scene(), beam.name, 4)
    stay = apart.connectors[0]
    assert stay.body_b != beam.name and stay.body_b in {body.name for body in apart.bodies}
    loads = []
    for each in (whole.scene(), apart):
        system = fm.compile(each)
        state = system.state(np.zeros(system.nq), np.zeros(system.nu))
        loads.append(system.evaluate(0.0, state.q, state.u).connectors["stay"])
    assert np.max(np.abs(loads[0] - loads[1])) <= 1e-12 * np.max(np.abs(loads[0]))


def test_many_copies_at_once():
    """Runs in lanes are those of single scenes."""
    system, count = fm.compile(free_flying()), 9
    state = system.initial_state
    q, u = np.tile(state.q, (count, 1)), np.tile(state.u, (count, 1)) * np.linspace(0.5, 1.0, count)[:, None]
    found = system.accelerations_batch(q, u)
    for i in (0, 4, 8):
        alone = system.accelerations(system.state(q[i], u[i]))
        assert np.max(np.abs(found.accelerations[i] - alone)) <= 1e-10 * np.max(np.abs(alone))


def test_an_equilibrium_hangs_on_its_springs():
    """A weight on a cable and a spring side by side: m g = (k1 + k2) x."""
    builder = fm.SceneBuilder("hanging", gravity=(0, 0, -9.81)).rigid_body("weight", mass=2.0, inertia=(1, 1, 1))
    builder.prismatic("rail", "ground", "weight", axis=(0, 0, -1), position=0.1)
    cable = {"position_a": (0, 0, 1), "free_length": 1.0, "stiffness": 100.0, "acts": "tension"}
    builder.spring_damper("cable", "ground", "weight", **cable)
    builder.linear_spring("spring", "rail", stiffness=50.0, damping=1.0)
    system = fm.compile(builder.scene())
    found = fm.equilibrium(system)
    assert abs(found.q[0] - 2.0 * 9.81 / 150.0) <= 1e-10


def test_dense_and_compiled_agree_without_gravity_too():
    scene = between_bodies(bodies(grounded=False, spin=3.0)).scene()
    system = fm.compile(scene)
    state, dense = system.initial_state, DenseSystem(scene)
    expected = dense.accelerations(0.0, state.q, state.u)
    assert np.max(np.abs(system.accelerations(state) - expected)) <= 1e-9 * np.max(np.abs(expected))
