"""Kratos' corotational beams: they converge with second order to level exact, in space too; loads, work, refusals."""

import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("KratosMultiphysics", reason="Kratos is not installed: pip install flexmb[kratos]")

from msgspec.structs import replace

from crosscheck.engines.contract import Effort, Run, Trajectory
from crosscheck.engines.kratos import KratosEngine
from crosscheck.engines.kratos import solve as kratos_solve
from crosscheck.engines.registry import engine
from flexmb.scene import schema as s
from flexmb.scene.functions import Pulse, SmoothStep, SpinUp

L = 1.0
ROD = s.BeamStation(
    x_m=0.0, EA_N=4e4, EIy_Nm2=4.0, EIz_Nm2=6.0, GJ_Nm2=3.0, mass_per_length_kg_m=0.5, rotary_y_kg_m=2e-4,
    rotary_z_kg_m=3e-4,
)  # fmt: skip
STRAINS = s.StrainPolynomials(axial=3, torsion=6, bending_y=6, bending_z=6)
TURNED = {"parent_position_m": (0.3, -0.2, 0.4), "parent_quaternion": (0.5, 0.5, -0.5, 0.5)}
WELD = s.Weld(name="root", parent="ground", child="rod", child_quaternion=(0.8, 0.0, 0.6, 0.0), **TURNED)
GROWING = SmoothStep(start_value=0.0, end_value=12.0, start_s=0.0, duration_s=0.3)


def scene_of(hinge: s.Hinge, beam: dict | None = None, **more: object) -> s.Scene:
    given = {"level": "exact", "elements": 32, "modes": s.Modes(count=0, polynomials=STRAINS)} | (beam or {})
    rod = s.BeamBody(**{"name": "rod", "length_m": L, "stations": (ROD, replace(ROD, x_m=L))} | given)
    markers = (s.Marker(name="tip", body="rod", node="tip", offset_m=(0.02, 0.03, -0.05)),)
    return s.Scene(name="rod", bodies=(rod,), hinges=(hinge,), markers=markers, **more)


def load(kind: str, direction: tuple[float, float, float], function: object = GROWING) -> s.Load:
    return s.Load(name=kind, body="rod", node="tip", type=kind, direction=direction, function=function)


def run(scene: s.Scene, step: float, duration: float) -> Trajectory:
    code = KratosEngine()
    assert code.supports(scene).kind == "surrogate"
    done = code.compile(scene).simulate(Run(np.linspace(0.0, duration, 21)), Effort("step", step, "BDF2"))
    assert done.status == "finished", done.message
    return done


def outputs(done: Trajectory) -> dict[str, np.ndarray]:
    tip = done.markers["tip"]
    found = {"position": tip.position, "quaternion": tip.quaternion, "velocity": tip.velocity}
    found |= {"load": done.loads["root"], "momentum": done.momentum, "work": done.work} | done.drives
    return found | {kind: done.energy[kind] for kind in ("kinetic", "strain", "gravity")}


def errors(scene: s.Scene, duration: float, method: str = "radau5") -> tuple[dict[str, float], dict[str, float]]:
    """Largest differences from native at level exact, of its ranges: with a quarter of the elements and of the steps of
    the coarsest effort, and with that."""
    known = (
        engine("native").compile(scene).simulate(Run(np.linspace(0.0, duration, 21)), Effort("tolerance", 1e-8, method))
    )
    assert known.status == "finished", known.message
    truth = outputs(known)
    step = KratosEngine().efforts_for(scene, duration)[0].value
    coarse, fine = (outputs(run(scene, each, duration)) for each in (4.0 * step, step))
    assert coarse.keys() == fine.keys() == truth.keys()
    reach = {name: max(np.abs(values).max(), 1e-9) for name, values in truth.items()}
    first, last = (
        {name: float(np.abs(one[name] - truth[name]).max() / reach[name]) for name in truth} for one in (coarse, fine)
    )
    return first, last


def test_large_motion_in_space_converges_with_second_order() -> None:
    """Bent in both planes and twisted, by more than a radian. With a quarter of the step and of the length errors fall
    by 16, less what level exact itself lacks. Gravity, which begins at once, makes the rod ring along its axis."""
    loads = (load("force", (0.6, 0.8, 0.0)), load("torque", (0.0, 0.0, 1.0), replace(GROWING, end_value=3.0)))
    coarse, fine = errors(scene_of(WELD, loads=loads, gravity_m_s2=(0.0, 0.0, -3.0)), 0.3)
    assert max(fine.values()) < 3e-2, fine
    assert max(fine[name] for name in ("position", "quaternion", "momentum", "work", "gravity")) < 2e-3, fine
    assert all(fine[name] < coarse[name] / 8.0 for name in ("position", "quaternion", "strain")), (coarse, fine)


def test_prescribed_turn_has_its_drive_and_its_work() -> None:
    """About an axis that is no axis of World, of a beam that is held at its middle. What is left of the load is that
    sections have no gyroscopic moments in Kratos, which matter to this thick rod."""
    turn = s.AngularCoordinate(prescribed_rad=SpinUp(rate=6.0, duration_s=0.3))
    hinge = s.Revolute(
        name="root", parent="ground", child="rod", child_node="middle", axis=(0.0, 0.6, 0.8), rotation=turn, **TURNED
    )
    beam = {"nodes": (s.BeamNode(name="middle", x_m=0.5),)}
    coarse, fine = errors(scene_of(hinge, beam), 0.6)
    assert max(fine.values()) < 5e-3, fine
    assert fine["root"] < coarse["root"] / 8.0


def flight(node: str, **turning: float) -> s.Scene:
    """A free beam that is pushed at a node along World z, in its plane, by 3 N until a jump at 0.2 s."""
    hinge = s.Planar(
        name="root", parent="ground", child="rod", x=s.LinearCoordinate(rate_m_s=1.0),
        rotation=s.AngularCoordinate(angle_rad=0.4, **turning), **TURNED,
    )  # fmt: skip
    push = s.Load(
        name="push", body="rod", node=node, type="force", direction=(0.0, 0.0, 1.0),
        function=Pulse(value=3.0, start_s=0.0, duration_s=0.2),
    )  # fmt: skip
    return scene_of(hinge, {"elements": 4, "nodes": (s.BeamNode(name="middle", x_m=0.5),)}, loads=(push,))


def missed(scene: s.Scene, step: float) -> float:
    """What the momentum gained in 0.4 s differs by from the impulse (N s)."""
    momentum = run(scene, step, 0.4).momentum[:, 3:]
    return float(np.linalg.norm(momentum[-1] - momentum[0] - [0.0, 0.0, 0.6]))


def test_flight_in_the_plane_takes_up_the_impulse_with_second_order() -> None:
    turning = flight("tip", rate_rad_s=3.0)
    assert missed(turning, 2.5e-4) < missed(turning, 5e-4) / 3.5 < 5e-4


def test_steps_begin_anew_at_a_jump(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else the velocities before the jump count as if the force had ended half a step later: first order."""
    assert missed(flight("middle"), 1e-3) < 1e-5
    monkeypatch.setattr(kratos_solve, "jumps", lambda function: ())
    step = 0.02 / 32  # the power of two between samples
    assert missed(flight("middle"), 1e-3) == pytest.approx(3.0 * step / 2.0, rel=0.1)


def test_sections_have_inertia_about_the_axis() -> None:
    """A clamped rod under a sudden torque, in closed form: Kratos' Bossak scheme would let it follow without delay."""
    tap = load("torque", (1.0, 0.0, 0.0), Pulse(value=1e-3, start_s=0.0, duration_s=10.0))
    hinge = s.Weld(name="root", parent="ground", child="rod")
    omega = np.pi / 2.0 * np.sqrt(3.0 / 5e-4) / L
    scene = scene_of(hinge, {"elements": 32}, loads=(tap,))
    times = np.linspace(0.0, 2.0 * np.pi / omega, 65)
    efforts = KratosEngine().efforts_for(scene, times[-1])
    done = KratosEngine().compile(scene).simulate(Run(times), Effort("step", 2.0 * efforts[0].value, "BDF2"))
    twist = 2.0 * done.markers["tip"].quaternion[:, 1]
    odd = np.arange(1, 400, 2)[:, None]
    exact = 1e-3 * L / 3.0 * (1.0 - 8.0 / np.pi**2 * (np.cos(odd * omega * times) / odd**2).sum(axis=0))
    assert np.abs(twist - exact).max() < 0.06 * np.ptp(exact)


def test_a_run_whose_steps_have_no_solution_has_diverged() -> None:
    violent = scene_of(WELD, loads=(load("torque", (0.0, 1.0, 0.0), replace(GROWING, end_value=1e9)),))
    done = KratosEngine().compile(violent).simulate(Run(np.linspace(0.0, 0.4, 21)), Effort("step", 0.02, "BDF2"))
    assert done.status == "diverged"
    assert "no solution at t = " in done.message
    assert all(np.isfinite(path.position).all() for path in done.markers.values())


def test_importing_kratos_prints_nothing() -> None:
    """Workers have words of their own for standard output."""
    program = "from crosscheck.engines.kratos import library; library.load(); print('done')"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "done\n"


PLAIN = scene_of(WELD)
TILTED = ((4e4, 0, 0, 0, 0, 50.0), (0, 2e4, 0, 0, 0, 0), (0, 0, 2e4, 0, 0, 0), (0, 0, 0, 3, 0, 0), (0, 0, 0, 0, 4, 0))
COUPLED = replace(ROD, stiffness=(*TILTED, (50.0, 0, 0, 0, 0, 6.0)))
REFUSED = {
    "one beam and nothing else": replace(PLAIN, bodies=(*PLAIN.bodies, *PLAIN.bodies)),
    "has lumped masses": scene_of(WELD, {"tip_masses": (s.TipMass(x_m=L, mass_kg=1.0),)}),
    "turns with its node": replace(PLAIN, loads=(replace(load("force", (1.0, 0.0, 0.0)), frame="node"),)),
    "is rigid in this scene": scene_of(WELD, {"level": "rigid"}),
    "no modal damping": scene_of(WELD, {"modes": s.Modes(count=0, polynomials=STRAINS, viscosity_s=1e-3)}),
    "these couple": scene_of(WELD, {"stations": (COUPLED, replace(COUPLED, x_m=L))}),
    "needs GAy_N and GAz_N": scene_of(WELD, {"theory": "timoshenko"}),
    "welded to the ground or hinged": scene_of(s.Spherical(name="root", parent="ground", child="rod")),
    "on the axis of the beam": scene_of(replace(WELD, child_position_m=(0.0, 0.1, 0.0))),
    "has no spring, damper or motor": scene_of(
        s.Revolute(name="root", parent="ground", child="rod", rotation=s.AngularCoordinate(stiffness_Nm_rad=1.0))
    ),
}


@pytest.mark.parametrize("reason", REFUSED)
def test_what_it_does_not_take_is_refused_by_name(reason: str) -> None:
    support = KratosEngine().supports(REFUSED[reason])
    assert support.kind == "no"
    assert reason in support.reason
    with pytest.raises(ValueError, match=reason):
        KratosEngine().compile(REFUSED[reason])
