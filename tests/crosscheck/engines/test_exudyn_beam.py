"""Exudyn's beams of finite deflection: published spin-up manoeuvres, a stiff beam that turns, and refusals."""

import numpy as np
import pytest

pytest.importorskip("exudyn", reason="Exudyn is not installed: pip install flexmb[peers]")

from msgspec.structs import replace

from crosscheck.engines.contract import Effort, Run, Support, Trajectory
from crosscheck.engines.exudyn import ExudynBeamEngine
from crosscheck.engines.functions_of_time import profile
from flexmb.scene import schema as s
from flexmb.scene.functions import SpinUp

BEAM_K = {"length": 8.0, "EA": 5.03127e6, "EI": 566.654, "mass": 0.201880, "rotary": 0.0, "GA": 1.6e6, "rate": 4.0}
BEAM_S = {"length": 10.0, "EA": 2.8e7, "EI": 1.4e4, "mass": 1.2, "rotary": 6e-4, "GA": 1e7, "rate": 6.0}


def spin_up(data: dict, theory: str, elements: int, free: bool = False) -> s.Scene:
    stations = tuple(
        s.BeamStation(
            x_m=x, EA_N=data["EA"], EIy_Nm2=data["EI"], EIz_Nm2=data["EI"], GJ_Nm2=data["EI"], GAy_N=data["GA"],
            mass_per_length_kg_m=data["mass"], rotary_z_kg_m=data["rotary"], rotary_y_kg_m=data["rotary"],
        )
        for x in (0.0, data["length"])
    )  # fmt: skip
    beam = s.BeamBody(
        name="beam", length_m=data["length"], elements=elements, stations=stations, theory=theory,
        modes=s.Modes(count=3, families=("bending_y",)),
    )  # fmt: skip
    driven = s.AngularCoordinate(prescribed_rad=SpinUp(rate=data["rate"], duration_s=15.0))
    turn = s.AngularCoordinate(angle_rad=0.3, rate_rad_s=2.0) if free else driven
    return s.Scene(
        name="spin-up", bodies=(beam,), markers=(s.Marker(name="tip", body="beam", node="tip"),),
        hinges=(s.Revolute(name="hub", parent="ground", child="beam", rotation=turn),),
    )  # fmt: skip


def tip_minimum(scene: s.Scene, step: float) -> tuple[float, float]:
    """Largest backward deflection of the tip across the hub's axis, and when: a parabola through the lowest samples."""
    run = (
        ExudynBeamEngine()
        .compile(scene)
        .simulate(Run(np.linspace(0.0, 8.0, 401)), Effort("step", step, "GeneralizedAlpha"))
    )
    assert run.status == "finished"
    across = _deflection(run, scene.hinges[0].rotation.prescribed_rad)
    k = int(across.argmin())
    curve = np.polyfit(run.times[k - 1 : k + 2] - run.times[k], across[k - 1 : k + 2], 2)
    shift = -curve[1] / (2.0 * curve[0])
    return float(np.polyval(curve, shift)), float(run.times[k] + shift)


def _deflection(run: Trajectory, function: SpinUp) -> np.ndarray:
    angle = np.array([profile(function)(t).value for t in run.times])
    x, y, _ = run.markers["tip"].position.T
    return np.cos(angle) * y - np.sin(angle) * x


def test_beam_k_spin_up_deflects_as_published():
    """Step-converged -0.53365 m at 6.765 s (independent runs of cable and geometrically exact elements)."""
    scene = spin_up(BEAM_K, "euler-bernoulli", 16)
    fine, coarse = tip_minimum(scene, 0.005), tip_minimum(scene, 0.01)
    deepest = fine[0] + (fine[0] - coarse[0]) / 3.0
    # the data are rounded to five digits here, and element and sampling errors are some 1e-5
    assert deepest == pytest.approx(-0.53365, abs=5e-5)
    assert fine[1] == pytest.approx(6.765, abs=2e-3)


@pytest.mark.parametrize("elements", [8, 16])
def test_beam_s_spin_up_deflects_as_published(elements):
    """A geometrically exact code gives -0.57372 (16 elements) and -0.57398 (32), linear theory -0.57436 at 6.762 s."""
    deepest, when = tip_minimum(spin_up(BEAM_S, "timoshenko", elements), 0.0025)
    assert -0.57436 < deepest < -0.57372
    assert when == pytest.approx(6.762, abs=3e-3)


def test_free_stiff_beam_turns_at_its_rate():
    """A free hinge carries no torque, and holds the centripetal force m w^2 L/2 of a nearly rigid beam."""
    stiff = dict(BEAM_K, EA=5e8, EI=5e5)
    scene = spin_up(stiff, "euler-bernoulli", 4, free=True)
    model = ExudynBeamEngine().compile(scene)
    snapshot = model.evaluate()
    assert snapshot.markers["tip"].velocity == pytest.approx(
        [0, 0, 2.0, -16.0 * np.sin(0.3), 16.0 * np.cos(0.3), 0], abs=1e-9
    )
    run = model.simulate(Run(np.linspace(0.0, 1.0, 101)), Effort("step", 0.002, "GeneralizedAlpha"))
    assert run.status == "finished"
    assert np.abs(run.loads["hub"][:, 2]).max() == 0.0
    pull = np.linalg.norm(run.loads["hub"][50:, 3:5], axis=1)
    assert pull.mean() == pytest.approx(BEAM_K["mass"] * 8.0 * 4.0 * 4.0, rel=0.02)
    x, y, _ = run.markers["tip"].position[-1]
    assert np.arctan2(y, x) == pytest.approx(0.3 + 2.0, abs=2e-3)


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
def test_a_free_stiff_beam_is_thrown_by_its_loads(theory):
    """The mass centre follows Newton's law through the end of a pulse; the turn follows Euler's under a torque.

    The loads jump at the end of a step: a step that saw only one side would be out by its whole impulse.
    """
    data, L, T = dict(BEAM_K, EA=5e8, EI=5e7, GA=5e7, rotary=1e-3), 8.0, 0.5
    mass, step = data["mass"] * L, 2e-3
    inertia = mass * L**2 / 12 + data["rotary"] * L * (theory == "timoshenko")  # cables have no rotary inertia
    beam = spin_up(data, theory, 4).bodies[0]
    beam = replace(beam, nodes=(s.BeamNode(name="middle", x_m=L / 2),))
    free = s.Planar(
        name="free", parent="ground", child="beam", parent_position_m=(1.0, 2.0, 3.0),
        x=s.LinearCoordinate(position_m=0.5, rate_m_s=-1.0), y=s.LinearCoordinate(rate_m_s=2.0),
        rotation=s.AngularCoordinate(angle_rad=0.3),
    )  # fmt: skip
    push = s.Load(name="push", body="beam", node="middle", type="force", direction=(0.6, 0.8, 0.0),
                  function=s.Pulse(value=10.0, start_s=0.0, duration_s=T))  # fmt: skip
    twist = s.Load(name="twist", body="beam", node="middle", type="torque", direction=(0.0, 0.0, -1.0),
                   function=s.Pulse(value=4.0, start_s=0.0, duration_s=T))  # fmt: skip
    scene = s.Scene(
        name="thrown", bodies=(beam,), hinges=(free,), loads=(push, twist),
        markers=(s.Marker(name="middle", body="beam", node="middle"),),
    )  # fmt: skip
    assert ExudynBeamEngine().supports(scene).kind == "surrogate"
    times = np.linspace(0.0, 1.0, 11)
    run = ExudynBeamEngine().compile(scene).simulate(Run(times), Effort("step", step, "TrapezoidalIndex2"))
    assert run.status == "finished" and not run.loads["free"].any()
    grown = np.where(times < T, times**2 / 2, T * times - T**2 / 2)  # of a unit acceleration that lasts T
    middle = np.array([1.5 + 4.0 * np.cos(0.3), 2.0 + 4.0 * np.sin(0.3)])
    expected = middle + np.outer(times, [-1.0, 2.0]) + 10.0 / mass * np.outer(grown, [0.6, 0.8])
    path = run.markers["middle"]
    turn = 2.0 * np.unwrap(np.arctan2(path.quaternion[:, 3], path.quaternion[:, 0]), period=np.pi)
    impulse = 10.0 * T / mass * step  # what one step at the jump would be worth
    assert np.abs(path.position[:, :2] - expected).max() < 0.1 * impulse
    assert np.abs(path.position[:, 2] - 3.0).max() == 0.0
    assert np.abs(turn - 0.3 + 4.0 / inertia * grown).max() < 0.1 * 4.0 * T / inertia * step


def test_what_is_out_of_the_plane_goes_to_the_elements_in_space():
    """With rotary inertia, without which sections in space cannot turn."""
    scene = spin_up(dict(BEAM_K, rotary=1e-3), "euler-bernoulli", 4)
    engine = ExudynBeamEngine()
    assert engine.supports(scene) == Support("surrogate", "a planar beam of finite deflection instead of modes")
    assert len(engine.efforts(scene)) >= 3
    every_family = replace(scene.bodies[0], modes=s.Modes(count=3))
    tilted = replace(scene.hinges[0], axis=(0.0, 1.0, 0.0))
    push = s.Load(name="push", body="beam", node="tip", type="force", direction=(0.0, 0.0, 1.0),
                  function=s.Constant(value=1.0))  # fmt: skip
    sprung = s.Planar(name="hub", parent="ground", child="beam", x=s.LinearCoordinate(stiffness_N_m=1.0))
    for changed in (
        replace(scene, loads=(push,)),
        replace(scene, loads=(replace(push, type="torque", direction=(1.0, 0.0, 0.0)),)),
        replace(scene, loads=(replace(push, direction=(0.0, 1.0, 0.0), frame="node"),)),
        replace(scene, hinges=(sprung,)),
        replace(scene, gravity_m_s2=(0.0, 0.0, -9.8)),
        replace(scene, bodies=(every_family,)),
        replace(scene, hinges=(tilted,)),
    ):
        support = engine.supports(changed)
        assert support.kind == "surrogate" and "instead of modes; beam: shear" in support.reason
        assert len(engine.efforts(changed)) >= 3


def test_refusals_name_their_reason():
    scene = spin_up(dict(BEAM_K, rotary=1e-3), "euler-bernoulli", 4)
    off_axis = tuple(replace(station, reference_point_m=(0.02, 0.0)) for station in scene.bodies[0].stations)
    for changed, word in (
        (replace(scene, bodies=(replace(scene.bodies[0], stations=off_axis),)), "couples strains on the axis"),
        (replace(scene, bodies=(s.RigidBody(name="beam", mass_kg=1.0, inertia_kg_m2=np.eye(3).tolist()),)), "a beam"),
    ):
        support = ExudynBeamEngine().supports(changed)
        assert support.kind == "no" and word in support.reason
