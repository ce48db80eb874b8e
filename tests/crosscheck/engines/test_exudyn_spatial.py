"""Exudyn's beam elements in space: a closed form, level exact in motion, loops, momentum, faults and refusals."""

import numpy as np
import pytest

pytest.importorskip("exudyn", reason="Exudyn is not installed: pip install flexmb[peers]")

from msgspec.structs import replace
from scipy.integrate import solve_ivp

from crosscheck.engines.contract import Effort, Run, Trajectory
from crosscheck.engines.conventions import axis_rotation, cross_matrix
from crosscheck.engines.exudyn import ExudynBeamEngine
from crosscheck.engines.exudyn.beam_engine import BeamModel
from crosscheck.engines.exudyn.model import ExudynModel
from crosscheck.engines.registry import engine
from flexmb.scene import schema as s
from flexmb.scene.functions import SmoothStep
from flexmb.scene.sections import inertia_on_axis, matrix

L = 1.0
ROD = s.BeamStation(
    x_m=0.0, EA_N=1e6, EIy_Nm2=4.0, EIz_Nm2=6.0, GJ_Nm2=3.0, mass_per_length_kg_m=0.5, rotary_y_kg_m=2e-4,
    rotary_z_kg_m=3e-4,
)  # fmt: skip
STRAINS = s.StrainPolynomials(axial=3, torsion=6, bending_y=6, bending_z=6)
TORQUE, AXIS = 8.0, np.array([0.48, 0.6, 0.64])


def beam_of(station: s.BeamStation, elements: int = 8, **changes: object) -> s.BeamBody:
    given = {"level": "exact", "modes": s.Modes(count=0, polynomials=STRAINS)} | changes
    return s.BeamBody(name="rod", length_m=L, elements=elements, stations=(station, replace(station, x_m=L)), **given)


def clamped(beam: s.BeamBody, **more: object) -> s.Scene:
    return s.Scene(
        name="rod", bodies=(beam,), hinges=(s.Weld(name="clamp", parent="ground", child="rod"),),
        markers=(s.Marker(name="tip", body="rod", node="tip"),), **more,
    )  # fmt: skip


def run(scene: s.Scene, duration: float, step: float, method: str = "TrapezoidalIndex2") -> Trajectory:
    code = ExudynBeamEngine()
    assert code.supports(scene).kind == "surrogate"
    done = code.compile(scene).simulate(Run(np.linspace(0.0, duration, 21)), Effort("step", step, method))
    assert done.status == "finished", done.message
    return done


def refined(scene: s.Scene, factor: int) -> s.Scene:
    finer = (replace(body, elements=factor * body.elements) for body in scene.bodies if isinstance(body, s.BeamBody))
    return replace(scene, bodies=(*finer, *(body for body in scene.bodies if not isinstance(body, s.BeamBody))))


def at_rest(scene: s.Scene) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) and rotation (3,3) of the tip in equilibrium under the loads at t = 1 s, by Exudyn's own solver."""
    model = ExudynBeamEngine().compile(scene)
    assert isinstance(model, ExudynModel)
    shop, node = model.assembly.shop, model.assembly.bodies["rod"].at("tip").carrier.node
    settings = shop.exu.SimulationSettings()
    settings.solution.file.write = False
    settings.staticSolver.verboseMode, settings.staticSolver.numberOfLoadSteps = 0, 10
    settings.staticSolver.newton.relativeTolerance = settings.staticSolver.newton.absoluteTolerance = 1e-8
    shop.mbs.SolveStatic(settings)
    kinds = shop.exu.OutputVariableType
    return (
        np.array(shop.mbs.GetNodeOutput(node, kinds.Position)),
        np.array(shop.mbs.GetNodeOutput(node, kinds.RotationMatrix)).reshape(3, 3),
    )


def turned_by(station: s.BeamStation, elements: int) -> tuple[np.ndarray, np.ndarray]:
    """The tip of a clamped rod under a torque about AXIS at its tip."""
    torque = s.Load(
        name="turn", body="rod", node="tip", type="torque", direction=tuple(AXIS),
        function=SmoothStep(start_value=0.0, end_value=TORQUE, start_s=0.0, duration_s=1.0),
    )  # fmt: skip
    return at_rest(clamped(beam_of(station, elements), loads=(torque,)))


def test_a_round_rod_under_an_end_torque_is_a_helix():
    """With GJ = EIy = EIz = C a torque M e at the tip gives R(x) = exp(x M/C e~), whatever the axis e: elements of
    constant strains hold it without error."""
    C = 4.0
    position, turn = turned_by(replace(ROD, EIy_Nm2=C, EIz_Nm2=C, GJ_Nm2=C), 4)
    angle = TORQUE / C * L
    along = AXIS * AXIS[0]
    across = np.eye(3)[0] - along
    tip = L * (along + np.sin(angle) / angle * across + (1.0 - np.cos(angle)) / angle * np.cross(AXIS, across))
    assert position == pytest.approx(tip, abs=1e-7)
    assert turn == pytest.approx(axis_rotation(AXIS, angle), abs=1e-7)


def bent_by(station: s.BeamStation) -> np.ndarray:
    """[rotation, row by row; position] (12,) of the tip under the same torque, which every section carries: the
    solution of R' = R k~, r' = R e_x with K k = R' M e."""
    K = np.array([station.GJ_Nm2, station.EIy_Nm2, station.EIz_Nm2])

    def rate(x: float, state: np.ndarray) -> np.ndarray:
        R = state[:9].reshape(3, 3)
        return np.concatenate([(R @ cross_matrix(R.T @ AXIS * TORQUE / K)).ravel(), R[:, 0]])

    start = np.concatenate([np.eye(3).ravel(), np.zeros(3)])
    return solve_ivp(rate, (0.0, L), start, rtol=1e-10, atol=1e-12).y[:, -1]


def test_elements_of_any_section_converge_with_the_second_order():
    """To what the equations of a rod say; stretch and shear do nothing without a force. Doubled, GJ is noticed."""
    expected = bent_by(ROD)
    errors = []
    for elements in (8, 16):
        position, turn = turned_by(ROD, elements)
        errors.append(np.concatenate([turn.ravel(), position]) - expected)
    sizes = [np.linalg.norm(error) for error in errors]
    assert np.log2(sizes[0] / sizes[1]) == pytest.approx(2.0, abs=0.1)
    left = np.abs(errors[1] + (errors[1] - errors[0]) / 3.0).max()
    assert left < 0.05 * sizes[1]
    assert np.abs(bent_by(replace(ROD, GJ_Nm2=2.0 * ROD.GJ_Nm2)) - expected).max() > 100.0 * left


def swung(curvature: tuple[float, float, float], **station: float) -> s.Scene:
    """A rod with its mass centres off the axis and a lump at its tip, on a driven hinge, pushed askew."""
    plain = inertia_on_axis(ROD)
    offset = np.array([0.0, 0.01, -0.02])
    plain[3:, :3] = 0.5 * np.array([[0, -offset[2], offset[1]], [offset[2], 0, 0], [-offset[1], 0, 0]])
    plain[:3, 3:] = plain[3:, :3].T
    plain[3:, 3:] += 0.5 * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    heavy = replace(
        ROD, mass_per_length_kg_m=None, rotary_y_kg_m=0.0, rotary_z_kg_m=0.0, inertia=matrix(plain),
        curvature_1_m=curvature, **station,
    )  # fmt: skip
    lump = s.TipMass(
        x_m=L, mass_kg=0.2, com_m=(0.02, 0.03, 0.0),
        inertia_kg_m2=((3e-4, 0.0, 0.0), (0.0, 2e-4, 0.0), (0.0, 0.0, 4e-4)),
    )  # fmt: skip
    drive = s.AngularCoordinate(prescribed_rad=SmoothStep(start_value=0.2, end_value=1.4, start_s=0.0, duration_s=0.3))
    hinge = s.Revolute(
        name="hub", parent="ground", child="rod", parent_position_m=(0.1, 0.2, 0.3), child_position_m=(-0.1, 0.02, 0.0),
        parent_quaternion=(0.8, 0.0, 0.6, 0.0), child_quaternion=(0.96, 0.28, 0.0, 0.0), axis=(0.0, 0.6, 0.8),
        rotation=drive,
    )  # fmt: skip
    push = s.Load(name="push", body="rod", node="tip", type="force", direction=(0.0, 0.6, 0.8), frame="node",
                  function=SmoothStep(start_value=0.0, end_value=6.0, start_s=0.0, duration_s=0.2))  # fmt: skip
    points = (
        s.Marker(name="tip", body="rod", node="tip", offset_m=(0.0, 0.1, 0.05)),
        s.Marker(name="middle", body="rod", node="middle"),
    )
    beam = beam_of(heavy, tip_masses=(lump,), nodes=(s.BeamNode(name="middle", x_m=0.5),))
    return s.Scene(name="swung", bodies=(beam,), hinges=(hinge,), loads=(push,), markers=points)


def channels(done: Trajectory) -> np.ndarray:
    """(T,n) positions and quaternions of all markers."""
    return np.hstack([np.hstack([path.position, path.quaternion]) for path in done.markers.values()])


def as_exact(scene: s.Scene, duration: float, step: float) -> tuple[Trajectory, Trajectory, float]:
    """The runs of level exact and of the finer of two meshes, and what is left between the first and the extrapolation
    of the meshes with order 2, which is checked to be less than a quarter of the correction."""
    code = engine("native")
    ours = code.compile(scene).simulate(Run(np.linspace(0.0, duration, 21)), Effort("tolerance", 1e-7, "radau5"))
    coarse, fine = (run(refined(scene, factor), duration, step) for factor in (1, 2))
    correction = (channels(fine) - channels(coarse)) / 3.0
    left = float(np.abs(channels(fine) + correction - channels(ours)).max())
    assert left < 0.25 * np.abs(correction).max()
    return ours, fine, left


def typically(difference: np.ndarray, of: np.ndarray) -> float:
    """The median over time of the largest component, relative to the range: waves along the rod ring in loads."""
    return float(np.median(np.abs(difference).max(axis=1)) / np.abs(of).max())


@pytest.mark.parametrize("curvature", [(0.0, 0.0, 0.0), (0.8, 0.5, -0.7)])
def test_a_rod_that_bends_and_twists_moves_as_level_exact(curvature: tuple[float, float, float]):
    """What is left is the fourth order of the meshes, the error of the steps, and shear. Doubled, GJ is noticed."""
    scene = swung(curvature)
    ours, fine, left = as_exact(scene, 0.3, 5e-4)
    assert np.ptp(ours.markers["tip"].position, axis=0).max() > 0.3
    assert typically(fine.loads["hub"] - ours.loads["hub"], ours.loads["hub"]) < 0.02
    assert typically(fine.drives["hub"] - ours.drives["hub"], ours.drives["hub"]) < 0.02
    for kind in ("kinetic", "strain"):
        assert typically((fine.energy[kind] - ours.energy[kind])[:, None], ours.energy[kind]) < 0.02
    stiff = run(refined(swung(curvature, GJ_Nm2=2.0 * ROD.GJ_Nm2), 2), 0.3, 5e-4)
    assert np.abs(channels(stiff) - channels(fine)).max() > 20.0 * left


def test_a_loop_through_a_rod_closes_as_level_exact():
    """A driven crank and a rigid link push the tip of a clamped rod out of the plane of its weight."""
    beam = beam_of(ROD)
    link = s.RigidBody(
        name="link", mass_kg=0.1, com_m=(0.2, 0.0, 0.0), inertia_kg_m2=np.diag([1e-3, 2e-3, 2e-3]).tolist(),
        nodes=(s.Node(name="end", position_m=(0.4, 0.0, 0.0)),),
    )  # fmt: skip
    crank = s.RigidBody(
        name="crank", mass_kg=0.2, inertia_kg_m2=np.diag([1e-3, 1e-3, 1e-3]).tolist(),
        nodes=(s.Node(name="pin", position_m=(0.1, 0.0, 0.0)),),
    )  # fmt: skip
    driven = s.AngularCoordinate(prescribed_rad=SmoothStep(start_value=0.0, end_value=2.5, start_s=0.0, duration_s=0.3))
    base = clamped(beam, gravity_m_s2=(0.0, 0.0, -9.81))
    # the link leads from the pin at (0.9, 0, -0.4) up to the tip of the rod
    scene = replace(
        base, bodies=(beam, crank, link),
        hinges=(
            *base.hinges,
            s.Revolute(name="drive", parent="ground", child="crank", parent_position_m=(0.9, 0.0, -0.4),
                       axis=(0.0, 0.6, 0.8), rotation=driven),
            s.Spherical(name="pin", parent="crank", parent_node="pin", child="link",
                        quaternion=(np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0)),
        ),
        closures=(s.Closure(name="ball", type="spherical", body_a="rod", node_a="tip", body_b="link", node_b="end"),),
    )  # fmt: skip
    ours, fine, _ = as_exact(scene, 0.4, 5e-4)
    assert np.ptp(ours.markers["tip"].position[:, 1]) > 0.03
    for name in ("clamp", "ball", "drive"):
        assert typically(fine.loads[name] - ours.loads[name], ours.loads[name]) < 0.03
    assert np.abs(fine.energy["gravity"] - ours.energy["gravity"]).max() < 0.01 * np.ptp(ours.energy["gravity"])


def test_a_free_rod_keeps_its_momentum_and_energy():
    """To the second order of the steps; its spin pulls and bends it."""
    hinge = s.Free(
        name="free", parent="ground", child="rod", velocity_m_s=(1.0, 2.0, 3.0),
        angular_velocity_rad_s=(5.0, 20.0, -30.0),
    )  # fmt: skip
    scene = replace(clamped(beam_of(ROD)), hinges=(hinge,))
    drift = []
    for step in (1e-3, 5e-4):
        done = run(scene, 0.2, step)
        energy = sum(done.energy.values())
        moved = np.abs(done.momentum - done.momentum[0]).max() / np.linalg.norm(done.momentum[0])
        drift.append(max(moved, np.abs(energy / energy[0] - 1.0).max()))
    assert done.energy["strain"].max() > 2.0 * drift[1] * energy[0]
    assert drift[1] < 1e-3 and 3.0 < drift[0] / drift[1] < 5.0


def test_one_beam_in_the_plane_keeps_its_cheaper_elements():
    plane = s.Modes(count=0, polynomials=s.StrainPolynomials(bending_y=4))
    code = ExudynBeamEngine()
    assert isinstance(code.compile(clamped(beam_of(ROD, modes=plane))), BeamModel)
    assert isinstance(code.compile(clamped(beam_of(ROD))), ExudynModel)


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (clamped(beam_of(replace(ROD, reference_point_m=(0.02, 0.0)))), "couples strains"),
        (clamped(beam_of(replace(ROD, rotary_y_kg_m=0.0))), "need rotary inertia: give rotary_y_kg_m"),
        (clamped(beam_of(ROD, points="line")), 'use points = "section"'),
        (clamped(beam_of(replace(ROD, GJ_Nm2=None))), "has no GJ_Nm2"),
        (clamped(beam_of(ROD, modes=s.Modes(count=4, viscosity_s=1e-3))), "rate of strain"),
        (clamped(beam_of(ROD, modes=s.Modes(count=4, damping_ratio=0.01))), "no modal damping"),
        (clamped(beam_of(ROD, level="rigid")), "a beam that is not rigid"),
        (clamped(beam_of(ROD, modes=s.Modes(count=4), theory="timoshenko")), "needs GAy_N and GAz_N"),
        (
            clamped(beam_of(ROD), modal_states=(s.ModalState(body="rod", coordinates=(1.0,)),)),
            "begin at rest, and load the beam",
        ),
    ],
)
def test_what_the_elements_have_not_is_refused_with_the_remedy(scene: s.Scene, words: str):
    support = ExudynBeamEngine().supports(scene)
    assert support.kind == "no"
    assert words in support.reason
