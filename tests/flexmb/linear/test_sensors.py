"""What sensors say in a linear model: against what runs say at states beside, and under other torques."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.scene.shapes import beam_section
from tests.flexmb import spectral
from tests.flexmb.control.scenes import INERTIA, rotor

SPAN = 0.004
DIFFERENCED = 1e-8  # of the largest derivative; rounding of the loads over SPAN is a tenth of it


def everything_sensed(builder: fm.SceneBuilder, loads: tuple[str, ...]) -> fm.SceneBuilder:
    for quantity in ("position", "orientation", "velocity", "angular_velocity", "acceleration", "angular_acceleration",
                     "specific_force"):  # fmt: skip
        builder.sense_marker(quantity, "tip", quantity)
        if quantity != "orientation":
            builder.sense_marker(f"own {quantity}", "tip", quantity, frame="marker")
    builder.sense_distance("apart", "tip", "hip").sense_time("clock").sense_profile("one", fm.Constant(value=1.0))
    for hinge in loads:
        builder.sense_load(f"load {hinge}", hinge)
    return builder


def tree() -> fm.Scene:
    """A free hub with a driven arm, a beam on it, and a wheel."""
    section = beam_section(E=2e9, G=8e8, A=6e-4, Iy=8e-8, Iz=5e-8, rho=1500.0)
    builder = (
        fm.SceneBuilder("sensed tree", gravity=(0.3, 0.1, -2.0))
        .rigid_body("hub", mass=3.0, com=(0.02, 0.0, 0.01), inertia=(0.2, 0.25, 0.3))
        .rigid_body("arm", mass=0.8, com=(0.2, 0.01, 0.0), inertia=(0.02, 0.03, 0.025))
        .beam("rod", length=0.8, elements=4, section=section, modes=2)
        .free("flight", "ground", "hub", quaternion=(0.8, 0.36, -0.48, 0.0), angular_velocity=(0.4, -0.7, 0.5),
              velocity=(0.2, 0.1, -0.1))
        .revolute("driven", "hub", "arm", axis=(0, 0.6, 0.8), parent_position=(0.3, 0.2, 0.1),
                  prescribed=fm.Sine(amplitude=0.3, angular_frequency_rad_s=2.0, phase_rad=0.4))
        .revolute("elbow", "arm", "rod", axis=(0, 1, 0), angle=0.4, rate=0.8, parent_position=(0.4, 0, 0))
        .wheel("wheel", "hub", axis=(0, 1, 0), mass=0.3, axial_inertia=2e-3, transverse_inertia=1.2e-3, speed=8.0)
        .modal_state("rod", coordinates=(0.01, -0.005), rates=(0.1, 0.05))
        .marker("tip", "rod", node="tip").marker("hip", "hub", offset=(0.1, 0, 0))
        .sense_coordinate("attitude", "flight").sense_coordinate("bend rate", "rod.modes", quantity="rate")
        .sense_drive("drive", "driven.rotation").sense_drive("free", "elbow.rotation")
    )  # fmt: skip
    return everything_sensed(builder, ("flight", "driven", "elbow")).scene()


def four_bar() -> fm.Scene:
    """A crank, a coupler and a rocker of unequal lengths; revolute closures leave its loads out of plane undetermined.
    """
    builder = fm.SceneBuilder("sensed four-bar", gravity=(0, 0, -9.81))
    for name, length in (("crank", 0.4), ("coupler", 0.9), ("rocker", 0.7)):
        builder.rigid_body(name, mass=length, com=(length / 2, 0.01, 0.02), inertia=(0.01, 0.05, 0.06))
    builder.revolute("root", "ground", "crank", axis=(0, -1, 0), angle=1.0, rate=2.0)
    builder.revolute("pin", "crank", "coupler", axis=(0, -1, 0), angle=-0.6, parent_position=(0.4, 0, 0))
    builder.revolute("base", "ground", "rocker", axis=(0, -1, 0), angle=1.8, parent_position=(0.9, 0, 0))
    builder.closure("loop", "revolute", "coupler", "rocker", axis=(0, 1, 0), position_a=(0.9, 0, 0),
                    position_b=(0.7, 0, 0))  # fmt: skip
    builder.marker("tip", "coupler", offset=(0.5, 0.1, 0.2)).marker("hip", "rocker", offset=(0.1, 0, 0))
    builder.sense_coordinate("dependent", "base", quantity="rate")
    return everything_sensed(builder, ("root", "pin", "base", "loop")).scene()


def said(scene: fm.Scene, state: fm.State | None) -> Any:
    """All signals at a state; runs have them where there is a controller."""
    idle = fm.StateSpace(name="idle", inputs=("clock",), D=((0.0,),))
    run = fm.simulate(msgspec.structs.replace(scene, controllers=(idle,)), 1e-3, state=state, samples=2)
    return np.concatenate([run.signals[sensor.name][0] for sensor in scene.sensors])


def determined(scene: fm.Scene, signals: Any) -> Any:
    """Which signals the motion determines: not the loads out of the plane of a loop that is closed in space."""
    known = ~np.isnan(signals)
    assert known.all() == (not scene.closures) and known.sum() > 0.6 * len(known)
    return known


@pytest.mark.parametrize("make", [tree, four_bar])
@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_by_the_state_as_runs_beside_it_say(make: Any) -> None:
    scene = make()
    system = fm.compile(scene)
    state, model = system.initial_state, fm.linearize(system)
    n, names = len(model.rates), [name for name, _ in model.outputs]
    sensors = len(said(scene, None))
    C = model.C[-sensors:]
    assert names[-sensors] in ("attitude[0]", "dependent")
    everything = [name for name, _ in system.state_names[1]]
    speeds = model.C[[names.index(name) for name in everything if name in names]]
    moving = [i for i, name in enumerate(everything) if name in names]
    rng = np.random.default_rng(3)
    for _ in range(2):
        z = rng.normal(size=2 * n)

        def beside(x: float, z: Any = z) -> Any:
            u = state.u.copy()
            u[moving] += x * (speeds @ z)
            return said(scene, system.state(state.q + x * (model.motion @ z[:n]), u))

        found, _ = spectral.at_zero(np.array([beside(x) for x in spectral.times(SPAN)]), SPAN)
        known = determined(scene, found)
        np.testing.assert_array_equal(np.isnan(C).all(axis=1), ~known)
        assert np.max(np.abs((C @ z - found)[known])) <= DIFFERENCED * np.max(np.abs(found[known]))


def test_loads_and_accelerations_answer_a_harmonic_load_at_once() -> None:
    """Far above all resonances a response is that of a rigid push, D; without D it would vanish."""
    model = fm.linearize(tree())
    names = [name for name, _ in model.outputs]
    j = [name for name, _ in model.inputs].index("elbow.rotation")
    found = model.frequency_response("elbow.rotation", [1e9])
    pushed = names.index("load elbow[4]")
    assert found[-1][pushed] == pytest.approx(model.D[pushed, j], rel=1e-6) and abs(model.D[pushed, j]) > 1e-3


@pytest.mark.parametrize(("make", "hinge"), [(tree, "elbow"), (four_bar, "pin")])
@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_by_a_torque_at_once(make: Any, hinge: str) -> None:
    """Loads and accelerations are linear in it; motions do not feel it yet."""
    scene = make()
    model, before = fm.linearize(scene), said(scene, None)
    d = model.D[-len(before):, [name for name, _ in model.inputs].index(f"{hinge}.rotation")]
    pushed = scene.with_values({f"{hinge}.rotation.torque_Nm": fm.Constant(value=64.0)})
    found = (said(pushed, None) - before) / 64.0
    known = determined(scene, found)
    assert np.max(np.abs(found[known])) > 0.1
    assert np.max(np.abs((d - found)[known])) <= 1e-10 * np.max(np.abs(found[known]))


def test_a_controller_that_reads_a_load_through_a_filter() -> None:
    """J theta'' = -3 x + f, x' = -2 x + the torque that the hinge transmits, which is -3 x + f."""
    law = fm.StateSpace(name="law", inputs=("torque[2]",), A=((-2.0,),), B=((1.0,),), C=((-3.0,),))
    model = fm.linearize(rotor(fm.LoadSensor(name="torque", hinge="pivot"), law))
    expected = [[0.0, 1.0, 0.0], [0.0, 0.0, -3.0 / INERTIA], [0.0, 0.0, -5.0]]
    assert np.max(np.abs(model.A - expected)) <= 1e-9
    assert model.B[:, 0] == pytest.approx([0.0, 1.0 / INERTIA, 1.0], abs=1e-9)
    row = [name for name, _ in model.outputs].index("torque[2]")
    assert model.C[row] == pytest.approx([0.0, 0.0, -3.0], abs=1e-9) and model.D[row, 0] == pytest.approx(1.0)


@pytest.mark.parametrize(("make", "hinge"), [(tree, "elbow"), (four_bar, "pin")])
@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_the_loop_is_that_of_the_open_model_closed_by_hand(make: Any, hinge: str) -> None:
    """A motor v = -3 x of a lag x' = -2 x + y, y a force across the hinge that it drives."""
    law = fm.StateSpace(name="law", inputs=(f"load {hinge}[3]",), A=((-2.0,),), B=((1.0,),), C=((-3.0,),))
    scene = make()
    driven = scene.with_values({f"{hinge}.rotation.torque_Nm": fm.ControlSignal(source="law")})
    loop = fm.compile(msgspec.structs.replace(driven, controllers=(law,)))
    found, model = fm.linearize(loop), fm.linearize(scene)
    j = [name for name, _ in model.inputs].index(f"{hinge}.rotation")
    y = [name for name, _ in model.outputs].index(f"load {hinge}[3]")
    b, c, d = model.B[:, [j]], model.C[[y]], model.D[y, j]
    A = np.block([[model.A, -3.0 * b], [c, np.array([[-2.0 - 3.0 * d]])]])
    assert np.max(np.abs(found.A - A)) <= 1e-9 * np.max(np.abs(A))
    assert np.max(np.abs(found.B - np.vstack([model.B, model.D[[y]]]))) <= 1e-9 * np.max(np.abs(model.B))
    assert np.max(np.abs(found.C[y] - np.r_[c[0], -3.0 * d])) <= 1e-9 * np.max(np.abs(c)) and abs(d) > 1e-3
    pushed = fm.ControlledMotion(loop).acceleration_derivatives(loop.initial_state).of_rates.by_force
    assert pushed[0, loop.speed(hinge)] == pytest.approx([d], rel=1e-9)


def test_markers_at_one_place_have_no_distance_to_differentiate() -> None:
    scene = rotor()
    same = msgspec.structs.replace(scene.markers[0], name="same")
    apart = fm.DistanceSensor(name="apart", marker_a="rim", marker_b="same")
    scene = msgspec.structs.replace(scene, markers=(*scene.markers, same), sensors=(apart,))
    with pytest.raises(fm.DynamicsError, match='sensor "apart".*one place'):
        fm.linearize(scene)
