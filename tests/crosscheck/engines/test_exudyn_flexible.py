"""Exudyn's floating frames fed with our points and modes: against point sums, the native code and conservation."""

import numpy as np
import pytest

pytest.importorskip("exudyn", reason="Exudyn is not installed: pip install flexmb[peers]")

from msgspec.structs import replace

from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.conventions import cross_matrix
from crosscheck.engines.exudyn import ExudynEngine
from crosscheck.engines.exudyn.model import ExudynModel
from crosscheck.engines.native import NativeEngine
from flexmb.scene import schema as s
from flexmb.scene.functions import Constant, Sine, SpinUp
from flexmb.scene.modal_data import modal_arrays
from flexmb.surrogate import modal_points
from tests.crosscheck.engines.randomise import randomise

EVERY_FAMILY = ("axial", "torsion", "bending_y", "bending_z")


def beam(families=("bending_y", "bending_z"), count=4, boundary="clamped-free", **more) -> s.BeamBody:
    """Beam K of the spin-up manoeuvre, with a rotary inertia that torsion needs."""
    stations = tuple(
        s.BeamStation(
            x_m=x, EA_N=5.0312e6, EIy_Nm2=566.6352, EIz_Nm2=566.6352, GJ_Nm2=435.0, mass_per_length_kg_m=0.201886,
            rotary_y_kg_m=2e-4, rotary_z_kg_m=2e-4,
        )
        for x in (0.0, 8.0)
    )  # fmt: skip
    modes = s.Modes(count=count, families=families, boundary=boundary)
    return s.BeamBody(name="beam", length_m=8.0, elements=16, stations=stations, modes=modes, **more)


def flying(boundary: str) -> s.Scene:
    """One free-flying beam at a random state, its deflections a few centimetres: with decimetres it is chaotic."""
    scene = s.Scene(
        name="flying", bodies=(beam(boundary=boundary),),
        hinges=(s.Free(name="free", parent="ground", child="beam", child_node="tip"),),
        markers=(s.Marker(name="tip", body="beam", node="tip", offset_m=(0.1, 0.2, 0.3)),),
    )  # fmt: skip
    scene = randomise(modal_points(scene), np.random.default_rng(1))
    state = scene.modal_states[0]
    small = replace(state, coordinates=_tenth(state.coordinates), rates=_tenth(state.rates))
    return replace(scene, modal_states=(small,))


def _tenth(values: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(0.1 * value for value in values)


def craft(hinge: s.Hinge, gravity=(0.0, 0.0, 0.0), **more) -> s.Scene:
    """A hub with a wheel and a beam on `hinge` (from "hub" to "beam"), a force at the tip; a random state."""
    hub = s.RigidBody(
        name="hub", mass_kg=2.0, com_m=(0.3, 0.1, -0.05), nodes=(s.Node(name="flange", position_m=(0.5, 0.0, 0.0)),),
        inertia_kg_m2=((0.3, 0.02, 0.01), (0.02, 0.5, 0.03), (0.01, 0.03, 0.6)),
    )  # fmt: skip
    wheel = s.Wheel(
        name="wheel", body="hub", axis=(0.0, 0.6, 0.8), mass_kg=0.5, axial_inertia_kg_m2=0.02,
        transverse_inertia_kg_m2=0.012, speed_rad_s=30.0,
    )  # fmt: skip
    scene = s.Scene(
        name="craft", gravity_m_s2=gravity, bodies=(hub, beam(EVERY_FAMILY)), wheels=(wheel,),
        hinges=(s.Free(name="free", parent="ground", child="hub"), hinge),
        markers=(s.Marker(name="tip", body="beam", node="tip", offset_m=(0.1, 0.2, 0.3)),), **more,
    )  # fmt: skip
    return randomise(modal_points(scene), np.random.default_rng(2))


ENDS = {
    "name": "joint", "parent": "hub", "parent_node": "flange", "child": "beam",
    "child_position_m": (-0.1, 0.2, 0.1), "child_quaternion": (0.8, 0.0, 0.6, 0.0),
}  # fmt: skip
JOINTS = {
    "weld": s.Weld(**ENDS),
    "sprung": s.Revolute(axis=(0.0, 0.6, 0.8), rotation=s.AngularCoordinate(stiffness_Nm_rad=3.0), **ENDS),
    "driven": s.Revolute(
        rotation=s.AngularCoordinate(prescribed_rad=Sine(amplitude=1.0, angular_frequency_rad_s=2.0)), **ENDS
    ),
    "ball": s.Spherical(stiffness_Nm_rad=2.0, **ENDS),
}
PUSH = s.Load(
    name="push", body="beam", node="tip", type="force", direction=(0.0, 0.6, 0.8), function=Constant(value=2.0)
)


def point_sum_mass_matrix(body: s.ModalBody, eta: np.ndarray) -> np.ndarray:
    """sum m J'J over the points, J the velocity map of [modes; angular; linear] in body axes."""
    arrays = modal_arrays(body)
    M = np.zeros((len(eta) + 6, len(eta) + 6))
    for mass, r, Phi in zip(arrays.mass, arrays.position, arrays.translation_modes, strict=True):
        J = np.hstack([Phi, -cross_matrix(r + Phi @ eta), np.eye(3)])
        M += mass * J.T @ J
    return M


@pytest.mark.parametrize("boundary", ["clamped-free", "free-free"])
def test_mass_matrix_is_the_sum_over_points(boundary):
    scene = flying(boundary)
    expected = point_sum_mass_matrix(scene.bodies[0], np.array(scene.modal_states[0].coordinates))
    M = ExudynModel(scene).mass_matrix()
    # both sum some 100 points in double precision
    assert np.abs(M - expected).max() < 1e-13 * np.abs(expected).max()


@pytest.mark.parametrize("joint", JOINTS)
def test_pointwise_results_are_the_native_ones(joint):
    """Accelerations, loads, drives, energy and momentum of `full`, gravity and a tip force included."""
    scene = craft(JOINTS[joint], gravity=(1.0, 2.0, -3.0), loads=(PUSH,))
    assert ExudynEngine().supports(scene).kind == "exact"
    ours, theirs = NativeEngine().compile(scene).evaluate(), ExudynEngine().compile(scene).evaluate()
    a, b = ours.markers["tip"].acceleration, theirs.markers["tip"].acceleration
    assert np.abs(a - b).max() < 1e-9 * np.abs(a).max()
    for group in ("loads", "wheel_loads", "drives"):
        for name, load in getattr(ours, group).items():
            assert np.abs(load - getattr(theirs, group)[name]).max() < 1e-9 * max(1.0, np.abs(load).max())
    for kind, energy in ours.energy.items():
        assert theirs.energy[kind] == pytest.approx(energy, rel=1e-12)
    assert theirs.momentum == pytest.approx(ours.momentum, rel=1e-12)


def test_free_flight_keeps_momentum_energy_and_the_native_path():
    """Ten seconds, explicit: 1e-7 of the motion's range against the native code, momentum to the tolerance."""
    scene = flying("clamped-free")
    run = Run(np.linspace(0.0, 10.0, 51))
    exudyn = ExudynEngine().compile(scene).simulate(run, Effort("tolerance", 1e-11, "DOPRI5"))
    engine = NativeEngine()
    native = engine.compile(scene).simulate(run, engine.efforts(scene)[-1])
    path = native.markers["tip"].position
    assert np.abs(exudyn.markers["tip"].position - path).max() < 1e-7 * np.ptp(path, axis=0).max()
    energy = sum(exudyn.energy.values())
    assert np.ptp(energy) < 1e-9 * energy.max()
    assert np.ptp(exudyn.momentum, axis=0).max() < 1e-10 * np.abs(exudyn.momentum).max()


def test_weight_of_the_deformed_body_is_conservative():
    """With gravity the energy drift falls with the square of the step; without the deformation's moment it stays."""
    hinge = s.Spherical(name="ball", parent="ground", child="beam", quaternion=(0.8, 0.0, 0.6, 0.0))
    scene = s.Scene(name="pendulum", gravity_m_s2=(1.0, 2.0, -9.0), bodies=(beam(count=2),), hinges=(hinge,))
    model = ExudynEngine().compile(modal_points(scene))
    drift = []
    for h in (0.01, 0.005):
        run = model.simulate(Run(np.linspace(0.0, 1.0, 26)), Effort("step", h, "TrapezoidalIndex2"))
        energy = sum(run.energy.values())
        drift.append(np.ptp(energy) / np.ptp(run.energy["kinetic"]))
    assert drift[1] < 1e-4 and drift[0] / drift[1] > 3.5


def spin_up(rate: float) -> s.Scene:
    """Beam K on a driven hub about z, planar bending modes, to `rate` rad/s in 15 s."""
    drive = s.AngularCoordinate(prescribed_rad=SpinUp(rate=rate, duration_s=15.0))
    scene = s.Scene(
        name="spin-up", bodies=(beam(("bending_y",), 3),), markers=(s.Marker(name="tip", body="beam", node="tip"),),
        hinges=(s.Revolute(name="hub", parent="ground", child="beam", rotation=drive),),
    )  # fmt: skip
    return modal_points(scene)


def test_spin_up_below_the_critical_speed_follows_the_native_code():
    scene = spin_up(2.0)
    run = Run(np.linspace(0.0, 20.0, 101))
    native_engine = NativeEngine()
    native = native_engine.compile(scene).simulate(run, native_engine.efforts(scene)[-1])
    model = ExudynEngine().compile(scene)
    fine, coarse = (
        model.simulate(run, Effort("step", h, "TrapezoidalIndex2")).markers["tip"].position for h in (0.0008, 0.0016)
    )
    deflection = 0.3432  # m, largest of this manoeuvre, for the goal of 1e-4
    assert np.abs(fine - coarse).max() / 3.0 < 1e-4 * deflection
    assert np.abs(fine - native.markers["tip"].position).max() < 2.0 * np.abs(fine - coarse).max() / 3.0


def test_spin_up_above_the_critical_speed_ends_as_diverged_with_its_good_part():
    """The linear modal field is unstable above omega_1: the run says so, and keeps what came before."""
    run = ExudynEngine().compile(spin_up(4.0)).simulate(
        Run(np.linspace(0.0, 20.0, 101)), Effort("step", 0.01, "TrapezoidalIndex2")
    )
    assert run.status == "diverged" and "last good output" in run.message
    assert 10.0 < run.times[-1] < 20.0
    assert len(run.times) == len(run.markers["tip"].position) == len(run.loads["hub"])
    assert np.all(np.isfinite(run.loads["hub"]))


@pytest.mark.parametrize(("change", "word"), [({"level": "ruthless"}, "level"), ({"level": "stiffened"}, "level")])
def test_other_levels_are_refused(change, word):
    scene = modal_points(s.Scene(name="b", bodies=(beam(),), hinges=(s.Weld(name="w", parent="ground", child="beam"),)))
    changed = replace(scene, bodies=(replace(scene.bodies[0], **change),))
    support = ExudynEngine().supports(changed)
    assert support.kind == "no" and word in support.reason


def test_beams_and_rotary_points_are_refused_and_deforming_nodes_are_a_surrogate():
    weld = s.Weld(name="w", parent="ground", child="beam")
    scene = s.Scene(name="b", bodies=(beam(),), hinges=(weld,))
    assert "raw points and modes" in ExudynEngine().supports(scene).reason
    rotary = modal_points(replace(scene, bodies=(beam(EVERY_FAMILY, points="rotary"),)))
    assert "rotary inertia" in ExudynEngine().supports(rotary).reason
    tip = s.RigidBody(name="tip", mass_kg=1.0, inertia_kg_m2=((0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)))
    hung = s.Revolute(name="h", parent="beam", parent_node="tip", child="tip")
    support = ExudynEngine().supports(modal_points(replace(scene, bodies=(beam(), tip), hinges=(weld, hung))))
    assert support.kind == "surrogate" and "workless" in support.reason
