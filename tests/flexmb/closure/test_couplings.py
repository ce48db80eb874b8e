"""Couplings of hinge coordinates, as gears, belts and racks make them: closed forms, conserved quantities, messages."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

import flexmb
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder, angular, linear
from tests.bounds import UNIT_ROUNDOFF

ROUNDING = 64 * UNIT_ROUNDOFF  # a few dozen operations on one or two bodies


def disc(scene: SceneBuilder, name: str, axial: float, mass: float = 1.0) -> SceneBuilder:
    return scene.rigid_body(name, mass=mass, inertia=np.diag([axial, axial, axial]))


def _of(system: flexmb.System) -> tuple[np.ndarray, np.ndarray]:
    state = system.initial_state
    return state.q, state.u


def gears(ratio: float = -2.0, torque: float = 3.0, stiffness: float = 0.0, **of_led) -> s.Scene:
    """Flywheels of 0.3 and 0.2 kg m²; "B" turns `ratio` times as far as "A", on which the motor and a spring act."""
    scene = SceneBuilder("gears")
    disc(disc(scene, "a", 0.3), "b", 0.2)
    scene.revolute("A", "ground", "a", torque=s.Constant(value=torque), stiffness=stiffness)
    return scene.revolute("B", "ground", "b", **of_led).coupling("mesh", "B", {"A": ratio}).scene()


@pytest.mark.parametrize("algorithm", ["articulated", "composite"])
@pytest.mark.parametrize("ratio", [-2.0, 0.5, 30.0])
def test_geared_flywheels_have_the_inertia_i1_plus_n_squared_i2(ratio, algorithm):
    system = flexmb.compile(gears(ratio))
    found = system.evaluate(0.0, *_of(system), algorithm)
    rate = 3.0 / (0.3 + ratio**2 * 0.2)
    assert found.accelerations == pytest.approx([rate, ratio * rate], rel=ROUNDING)
    load = 0.2 * ratio * rate  # what turns b
    assert found.loads["mesh"] == pytest.approx([0, 0, load, 0, 0, 0], rel=ROUNDING, abs=0)
    assert found.loads["B"] == pytest.approx([0, 0, load, 0, 0, 0], rel=ROUNDING, abs=0)
    assert found.loads["A"] == pytest.approx([0, 0, 3.0 - ratio * load, 0, 0, 0], rel=4 * ROUNDING * ratio**2, abs=0)


def test_another_ratio_has_another_acceleration():
    """Negative control: the closed form would notice a ratio that is wrong by a millionth, or its inverse."""
    system = flexmb.compile(gears(-2.0 * (1.0 + 1e-6)))
    rate = 3.0 / (0.3 + 4.0 * 0.2)
    assert abs(system.accelerations(system.initial_state)[0] / rate - 1.0) > 1e-7


def test_a_rack_on_its_pinion():
    """Force on a rack of mass m, pinion of radius r: (m + I / r²) a = f; the rack pulls the pinion by I a / r²."""
    scene = SceneBuilder("rack and pinion")
    disc(scene, "pinion", 0.02).rigid_body("rack", mass=1.5, inertia=np.diag([0.1] * 3))
    scene.revolute("bearing", "ground", "pinion", axis=(0, 0, 1))
    scene.prismatic("guide", "ground", "rack", axis=(1, 0, 0), force=s.Constant(value=4.0))
    system = flexmb.compile(scene.coupling("teeth", "guide", {"bearing": 0.1}).scene())
    found = system.evaluate(0.0, *_of(system))
    a = 4.0 / (1.5 + 0.02 / 0.1**2)
    assert found.accelerations == pytest.approx([a / 0.1, a], rel=ROUNDING)
    assert found.loads["teeth"] == pytest.approx([0, 0, 0, -0.02 * a / 0.1**2, 0, 0], rel=ROUNDING, abs=0)


def atwood() -> SceneBuilder:
    """Masses of 3 and 2 kg on a rope over a pulley of 0.05 kg m² and 0.2 m."""
    scene = SceneBuilder("Atwood", gravity=(0, 0, -9.81))
    for name, mass in (("left", 3.0), ("right", 2.0)):
        scene.rigid_body(name, mass=mass, inertia=np.diag([0.01] * 3))
        scene.prismatic(f"hang {name}", "ground", name, axis=(0, 0, 1))
    disc(scene, "pulley", 0.05).revolute("axle", "ground", "pulley", axis=(0, 1, 0))
    return scene.coupling("rope left", "hang left", {"axle": 0.2}).coupling("rope right", "hang right", {"axle": -0.2})


def test_atwoods_machine():
    """a = (m1 - m2) g / (m1 + m2 + I / r²), and rope forces m (g - a), m (g + a) up."""
    system = flexmb.compile(atwood().scene())
    found = system.evaluate(0.0, *_of(system))
    a = (3.0 - 2.0) * 9.81 / (3.0 + 2.0 + 0.05 / 0.2**2)
    assert found.accelerations == pytest.approx([-a, a, -a / 0.2], rel=ROUNDING)
    assert found.loads["rope left"][5] == pytest.approx(3.0 * (9.81 - a), rel=ROUNDING)
    assert found.loads["rope right"][5] == pytest.approx(2.0 * (9.81 + a), rel=ROUNDING)
    assert (system.rank, system.closures.mobility) == (2, 1)


def test_atwoods_machine_falls_as_far_as_it_should():
    run = flexmb.simulate(atwood().scene(), 1.0, samples=11, rtol=1e-12, atol=1e-14)
    a = 9.81 / 6.25
    assert run.q[-1] == pytest.approx([-0.5 * a, 0.5 * a, -2.5 * a], rel=1e-11)
    assert np.max(np.abs(run.energy_drift)) <= 1e-11 * 3.0 * 9.81 * 0.5 * a


def differential() -> s.Scene:
    """A cage that turns by the mean of two half-shafts."""
    scene = SceneBuilder("differential")
    for name, axial in (("cage", 0.4), ("one", 0.1), ("other", 0.3)):
        disc(scene, name, axial)
    scene.revolute("Cage", "ground", "cage", torque=s.Constant(value=2.0))
    scene.revolute("One", "ground", "one", rate=1.0).revolute("Other", "ground", "other", rate=-3.0)
    return scene.coupling("planets", "Cage", {"One": 0.5, "Other": 0.5}).scene()


def test_a_differential_gives_both_shafts_the_same_torque():
    """I1 a1 = I2 a2 = s / 2, (a1 + a2) / 2 = (T - s) / I_c."""
    system = flexmb.compile(differential())
    state = system.initial_state
    assert state.u == pytest.approx([-1.0, 1.0, -3.0], rel=ROUNDING)
    torque = 2.0 / (1.0 + 0.4 * 0.25 * (1 / 0.1 + 1 / 0.3))
    one, other = 0.5 * torque / 0.1, 0.5 * torque / 0.3
    assert system.accelerations(state) == pytest.approx([0.5 * (one + other), one, other], rel=ROUNDING)


@pytest.mark.parametrize("method", INTEGRATORS)
def test_energy_is_conserved_by_all_methods(method):
    """Two geared flywheels on a spring: q = cos(w t) with w² = k / (I1 + n² I2)."""
    scene = gears(torque=0.0, stiffness=11.0)
    system = flexmb.compile(scene)
    w = np.sqrt(11.0 / 1.1)
    state = system.state(np.array([0.3, -0.6]), np.zeros(2))
    extra = {"step": 1e-3} if method in ("rk4", "generalised_alpha") else {}
    extra |= {"spectral_radius": 1.0} if method == "generalised_alpha" else {}
    run = flexmb.simulate(system, 2.0, method, state=state, samples=21, **extra)
    # generalised-alpha is of second order: (w h)² / 24 of the phase w t, and as much of it again for its average
    bound = {"generalised_alpha": (w * 1e-3) ** 2 * w * 2.0, "rk4": (w * 1e-3) ** 4}.get(method, 1e-8)
    assert np.max(np.abs(run.q[:, 0] - 0.3 * np.cos(w * run.t))) <= bound
    assert np.max(np.abs(run.q[:, 1] + 2.0 * run.q[:, 0])) <= 1e-13


def _free_base(**motion) -> SceneBuilder:
    scene = SceneBuilder("free base").rigid_body("base", mass=5.0, inertia=np.diag([1.0, 1.5, 2.0]))
    scene.free("float", "ground", "base", angular_velocity=(0.1, 0.2, 0.3), velocity=(0.3, 0.0, 0.1))
    for name, axis, place in (("one", (1, 0, 0), (0.5, 0, 0)), ("two", (0, 1, 0), (0, 0.4, 0.1))):
        scene.rigid_body(name, mass=1.0, com=(0.05, 0.02, 0.0), inertia=np.diag([0.02, 0.03, 0.04]))
        scene.revolute(f"turn {name}", "base", name, axis=axis, parent_position=place, **motion.get(name, {}))
    return scene.coupling("mesh", "turn two", {"turn one": -1.5}, offset=0.2)


def test_momentum_and_energy_of_a_free_base_with_geared_arms_are_conserved():
    """Gears between two arms on a base exert nothing from outside, whatever their axes: the base takes the reaction."""
    scene = _free_base(one={"rate": 2.0}).scene()
    system = flexmb.compile(scene)
    run = flexmb.simulate(system, 5.0, samples=11, rtol=1e-12, atol=1e-13)
    size = np.max(np.abs(run.momentum), axis=0)
    assert np.max(np.abs(run.momentum - run.momentum[0])) <= 1e-9 * np.max(size)
    assert np.max(np.abs(run.energy_drift)) <= 1e-9
    one, two = system.coordinate("turn one"), system.coordinate("turn two")
    assert np.max(np.abs(run.q[:, two] - 0.2 + 1.5 * run.q[:, one])) <= 1e-12


def test_initial_values_follow_from_what_is_given():
    """The led coordinate follows from the given one, or the other way round; both are kept where they fit."""
    scene = _free_base(one={"angle": 0.4, "rate": 2.0}).scene()
    state = flexmb.compile(scene).initial_state
    at = flexmb.compile(scene)
    assert state.q[at.coordinate("turn one")] == 0.4
    assert state.q[at.coordinate("turn two")] == pytest.approx(0.2 - 1.5 * 0.4, rel=ROUNDING)
    assert state.u[at.speed("turn two")] == pytest.approx(-3.0, rel=ROUNDING)
    led = flexmb.compile(_free_base(two={"angle": 0.5, "rate": 0.3}).scene()).initial_state
    assert led.q[at.coordinate("turn one")] == pytest.approx(0.3 / -1.5, rel=ROUNDING)
    assert led.u[at.speed("turn one")] == pytest.approx(0.3 / -1.5, rel=ROUNDING)


def test_given_values_that_contradict_a_coupling_are_refused_by_name():
    scene = _free_base(one={"angle": 0.4, "given": True}, two={"angle": 0.4, "given": True}).scene()
    with pytest.raises(flexmb.ClosureError, match='marked as given.*"turn one.*"turn two'):
        flexmb.compile(scene).initial_state  # noqa: B018


def test_a_redundant_coupling_changes_no_motion_and_leaves_loads_open():
    once = gears()
    twice = msgspec.structs.replace(once, couplings=(*once.couplings, msgspec.structs.replace(
        once.couplings[0], name="mesh too", hinge="A", terms=(s.CoupledCoordinate(hinge="B", ratio=-0.5),))))
    one, two = flexmb.compile(once), flexmb.compile(twice)
    assert (one.rank, two.rank) == (1, 1)
    found = two.evaluate(0.0, *_of(two))
    assert found.accelerations == pytest.approx(one.accelerations(one.initial_state), rel=ROUNDING)
    assert np.isnan(found.loads["mesh"][2]) and np.isnan(found.loads["mesh too"][2])
    assert found.loads["B"][2] == pytest.approx(0.2 * -2.0 * 3.0 / 1.1, rel=ROUNDING)


def test_contradictory_couplings_are_refused_by_name():
    scene = gears()
    other = s.Coupling(name="other", hinge="B", terms=(s.CoupledCoordinate(hinge="A", ratio=-2.0),), offset=0.1)
    with pytest.raises(flexmb.ClosureError, match='coupling "(mesh|other)".*no coordinates close it'):
        flexmb.compile(msgspec.structs.replace(scene, couplings=(*scene.couplings, other))).initial_state  # noqa: B018


def test_couplings_that_leave_no_motion_are_refused():
    scene = gears()
    other = s.Coupling(name="other", hinge="B", terms=(s.CoupledCoordinate(hinge="A", ratio=3.0),))
    with pytest.raises(flexmb.ClosureError, match='coupling "mesh", coupling "other" leave none of the 2 free speeds'):
        flexmb.simulate(msgspec.structs.replace(scene, couplings=(*scene.couplings, other)), 0.1)


@pytest.mark.parametrize("algorithm", ["articulated", "composite"])
def test_a_prescribed_coordinate_drives_the_coupled_one(algorithm):
    """The drive accelerates both flywheels: (I1 + n² I2) times the acceleration, and its work is their energy."""
    scene = SceneBuilder("driven")
    disc(disc(scene, "a", 0.3), "b", 0.2)
    ramp = s.Sine(amplitude=0.5, angular_frequency_rad_s=2.0)
    scene.revolute("A", "ground", "a", prescribed=ramp).revolute("B", "ground", "b").coupling("mesh", "B", {"A": -2.0})
    run = flexmb.simulate(scene.scene(), 2.0, algorithm=algorithm, samples=21, rtol=1e-12, atol=1e-14)
    acceleration = -0.5 * 4.0 * np.sin(2.0 * run.t)
    assert run.drives["A"][:, 0] == pytest.approx(1.1 * acceleration, abs=1e-12)
    assert np.max(np.abs(run.q[:, 1] + 2.0 * run.q[:, 0])) <= 1e-13
    assert np.max(np.abs(run.energy_drift)) <= 1e-11


def test_a_latch_stops_both_wheels_at_once():
    """The latch takes the momentum of both, seen at its coordinate: (I1 + n² I2) u."""
    scene = gears(torque=0.0)
    moving = scene.with_values({"A.rotation.rate_rad_s": 1.0})
    stop = s.SceneEvent(name="stop", watch="time", level=0.5, actions=(s.Latch(coordinate="A.rotation"),))
    moving = msgspec.structs.replace(moving, events=(stop,))
    run = flexmb.simulate(moving, 1.0, samples=11)
    assert run.q[-1] == pytest.approx([0.5, -1.0], rel=1e-9)
    assert np.max(np.abs(run.u[-1])) <= 1e-12
    struck = run.events[0]
    assert struck.impulses["A.rotation"] == pytest.approx(-1.1, rel=1e-9)
    assert struck.closures["mesh"][2] == pytest.approx(-0.2 * -2.0, rel=1e-9)


def test_linear_models_and_equilibria_know_couplings():
    scene = gears(torque=2.2, stiffness=11.0)
    system = flexmb.compile(scene)
    rest = flexmb.equilibrium(system)
    assert rest.q == pytest.approx([0.2, -0.4], rel=1e-10)
    found = flexmb.linearize(system, rest)
    frequencies = np.sort(np.abs(np.linalg.eigvals(found.A).imag))
    assert frequencies[-1] == pytest.approx(np.sqrt(10.0), rel=1e-12)


def test_coordinates_of_hinges_with_several_are_named():
    scene = SceneBuilder("cross").rigid_body("a", mass=1.0, inertia=np.diag([0.2, 0.3, 0.4]))
    scene.rigid_body("b", mass=2.0, inertia=np.diag([0.3] * 3))
    scene.universal("U", "ground", "a", first=angular(rate=1.0)).cylindrical("C", "ground", "b", translation=linear())
    scene.coupling("cam", "C", {("U", "second"): 0.1, ("C", "rotation"): 0.05}, coordinate="translation")
    system = flexmb.compile(scene.scene())
    found = system.evaluate(0.0, *_of(system))
    u = found.accelerations
    assert u[3] == pytest.approx(0.1 * u[1] + 0.05 * u[2], abs=1e-15)
    assert found.loads["cam"][:3] == pytest.approx(np.zeros(3), abs=0)


def test_stabilised_relations_stay_fulfilled():
    run = flexmb.simulate(_free_base(one={"rate": 2.0}).scene(), 2.0, samples=11, stabilise=5.0)
    system = flexmb.compile(_free_base().scene())
    one, two = system.coordinate("turn one"), system.coordinate("turn two")
    assert np.max(np.abs(run.q[:, two] - 0.2 + 1.5 * run.q[:, one])) <= 1e-8  # the tolerance 1e-10 over the run


def test_ratios_can_be_varied_by_their_paths():
    scene = gears().with_values({"mesh.terms.0.ratio": 3.0, "mesh.offset": 0.5})
    assert scene.couplings[0].terms[0].ratio == 3.0
    system = flexmb.compile(scene)
    assert system.accelerations(system.initial_state)[0] == pytest.approx(3.0 / (0.3 + 9.0 * 0.2), rel=ROUNDING)
    assert system.initial_state.q @ [-3.0, 1.0] == pytest.approx(0.5, rel=ROUNDING)


def test_controllers_read_the_load_of_a_coupling():
    """A law that gives the motor a torque from the load that the teeth transmit: T = 3 - 0.5 f."""
    scene = SceneBuilder("gears with a torque sensor")
    disc(disc(scene, "a", 0.3), "b", 0.2)
    scene.revolute("A", "ground", "a", torque=s.Constant(value=3.0))
    scene.revolute("B", "ground", "b").coupling("mesh", "B", {"A": -2.0})
    scene.angular_spring("drive", "A", torque=s.ControlSignal(source="law"))
    scene.sense_load("teeth", "mesh").state_space("law", ["teeth[2]"], D=[[-0.5]], period=0.01)
    run = flexmb.simulate(scene.scene(), 0.025, samples=[0.0, 0.015, 0.025])
    load = 0.2 * -2.0 * 3.0 / 1.1  # with the motor alone, at t = 0, which the law knows from t = 0 on
    first = 0.2 * -2.0 * (3.0 - 0.5 * load) / 1.1
    second = 0.2 * -2.0 * (3.0 - 0.5 * first) / 1.1
    assert run.loads["mesh"][1, 2] == pytest.approx(second, rel=1e-9)
