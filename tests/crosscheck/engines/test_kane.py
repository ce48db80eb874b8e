"""The witness of level full: answers as native's from the same data, planted errors are noticed, refusals by name."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

import flexmb as fm
from crosscheck.conformance.tree_scenes import bending
from crosscheck.engines.contract import Effort, Run, Snapshot
from crosscheck.engines.kane import KaneEngine
from crosscheck.engines.kane.beam import BendingBeam
from crosscheck.engines.kane.dynamics import KaneDynamics
from crosscheck.engines.kane.engine import compiled
from crosscheck.engines.kane.frames import _functions
from crosscheck.engines.kane.observer import KaneObserver
from crosscheck.engines.registry import engine
from flexmb.scene import schema as s
from flexmb.surrogate import modal_points, rigidify
from tests.repo.project import ROOT

CASES = ROOT / "cases"
FLEXIBLE = (
    "deploying_boom/flexible", "wheel_gyrostat/flexible_appendage", "spinning_beam/beam_k_supercritical",
    "spinning_beam/beam_s_subcritical",
)  # fmt: skip
RIGID = ("deploying_boom/rigid", "wheel_gyrostat/torque_driven", "wheel_gyrostat/dual_spinner")
SAME = 1e-10
"""Of the largest number of a kind: rounding of mass matrices whose conditions are up to 1e6."""


def scene_of(case: str) -> s.Scene:
    return fm.load_scene(CASES / case / "scene.toml")


def moved(scene: s.Scene, size: float = 0.05) -> s.Scene:
    """Under gravity, its bodies bent and vibrating."""
    rng = np.random.default_rng(0)
    bent = [body for body in scene.bodies if isinstance(body, s.ModalBody)]
    sizes = [len(body.stiffness) for body in bent]
    states = tuple(
        s.ModalState(
            body=body.name, coordinates=tuple(size * rng.standard_normal(m)), rates=tuple(rng.standard_normal(m))
        )
        for body, m in zip(bent, sizes, strict=True)
    )
    return replace(scene, modal_states=states, gravity_m_s2=(0.3, -1.0, 9.0))


def kinds(snapshot: Snapshot) -> dict[str, np.ndarray]:
    """All numbers, by their kind."""
    markers = snapshot.markers.values()
    turns = [marker.quaternion * np.sign(marker.quaternion[np.argmax(np.abs(marker.quaternion))]) for marker in markers]
    energies = np.array([snapshot.energy[kind] for kind in ("kinetic", "strain", "spring", "gravity")])
    assert snapshot.momentum is not None
    return {
        "position": np.array([marker.position for marker in markers]), "quaternion": np.array(turns),
        "velocity": np.array([marker.velocity for marker in markers]),
        "acceleration": np.array([marker.acceleration for marker in markers]),
        "load": np.array([snapshot.loads[name] for name in sorted(snapshot.loads)]),
        "wheel_load": np.array([snapshot.wheel_loads[name] for name in sorted(snapshot.wheel_loads)]),
        "drive": np.array([snapshot.drives[name] for name in sorted(snapshot.drives)]),
        "energy": energies, "momentum": snapshot.momentum,
    }  # fmt: skip


def apart(ours: dict[str, np.ndarray], theirs: dict[str, np.ndarray]) -> float:
    """Largest difference, each kind in units of its largest number, or of one unit."""
    worst = 0.0
    for kind, values in ours.items():
        assert values.shape == theirs[kind].shape
        if values.size:
            size = max(float(np.abs(values).max()), 1.0)
            worst = max(worst, float(np.abs(values - theirs[kind]).max()) / size)
    return worst


def both(scene: s.Scene) -> float:
    """How far the answers are from native's; scenes that do not deform, which the engine leaves to others, too."""
    return apart(kinds(engine("native").compile(scene).evaluate()), kinds(compiled(scene).evaluate()))


@pytest.mark.parametrize("case", FLEXIBLE)
def test_the_same_points_and_modes_give_the_same_at_a_bent_state(case: str) -> None:
    scene = moved(modal_points(scene_of(case)))
    assert KaneEngine().supports(scene).kind == "exact"
    assert both(scene) < SAME


@pytest.mark.parametrize("case", RIGID)
def test_rigid_bodies_and_wheels(case: str) -> None:
    assert both(replace(scene_of(case), gravity_m_s2=(0.3, -1.0, 9.0))) < SAME


@pytest.mark.parametrize("case", FLEXIBLE)
def test_sections_give_the_same_by_modes_of_its_own(case: str) -> None:
    """The modes of native are those of its elements, whose error is 1e-9 here."""
    scene = replace(scene_of(case), gravity_m_s2=(0.3, -1.0, 9.0))
    assert both(scene) < 1e-8


def test_a_beam_that_flies_alone_held_at_its_tip() -> None:
    """No joint at all, and a hinge whose frame on its body moves with the modes."""
    beam = scene_of(FLEXIBLE[1]).bodies[1]
    flight = s.Free(
        name="flight", parent="ground", child="panel", child_node="tip", angular_velocity_rad_s=(1.0, 0.2, 0.3),
        velocity_m_s=(0.1, 0.2, 0.3),
    )  # fmt: skip
    root = s.Marker(name="root", body="panel", offset_m=(0.1, 0.2, 0.3))
    scene = s.Scene(name="alone", bodies=(beam,), hinges=(flight,), markers=(root,))
    assert both(scene) < 1e-8 and both(moved(modal_points(scene))) < SAME


def test_levels_rigid_leave_the_modes_out() -> None:
    scene = scene_of(FLEXIBLE[0])
    still = replace(scene, bodies=tuple(
        replace(body, level="rigid") if isinstance(body, s.BeamBody) else body for body in scene.bodies
    ))  # fmt: skip
    points = tuple(
        replace(body, level="rigid") if isinstance(body, s.ModalBody) else body for body in modal_points(scene).bodies
    )
    ours = [kinds(compiled(each).evaluate()) for each in (still, replace(scene, bodies=points))]
    theirs = kinds(engine("native").compile(rigidify(scene)).evaluate())
    assert max(apart(each, theirs) for each in ours) < SAME


def test_modes_are_those_of_the_continuum() -> None:
    """sqrt(EI / (m L^4)) (beta L)^2, without rotary inertia."""
    beam = scene_of(FLEXIBLE[2]).bodies[0]
    assert isinstance(beam, s.BeamBody)
    thin = tuple(replace(station, rotary_y_kg_m=0.0, rotary_z_kg_m=0.0) for station in beam.stations)
    found = BendingBeam(replace(beam, stations=thin)).stiffness
    roots = np.array([1.875104068711961, 4.694091132974175, 7.854757438237612, 10.995540734875467])
    station = beam.stations[0]
    assert station.EIz_Nm2 is not None and station.mass_per_length_kg_m is not None
    scale = station.EIz_Nm2 / (station.mass_per_length_kg_m * beam.length_m**4)
    assert np.sort(np.diag(found)) == pytest.approx(scale * roots**4, rel=1e-12)


@pytest.mark.parametrize("angle", [1e-9, 1e-3, 0.3, 0.999999, 1.000001, 2.0, 7.0])
def test_functions_of_the_turn(angle: float) -> None:
    """The derivatives by differences: of |theta|^2, whose step leaves 1e-9."""
    square, h = np.array([angle**2]), 1e-5
    a, b, c, db, dc = _functions(square)[0]
    assert a == pytest.approx(np.sin(angle) / angle, rel=1e-14)
    assert b == pytest.approx(2.0 * (np.sin(angle / 2.0) / angle) ** 2, rel=1e-14)
    if angle > 1e-2:
        assert c == pytest.approx((angle - np.sin(angle)) / angle**3, rel=1e-10)
        ahead, behind = _functions(square + h)[0], _functions(square - h)[0]
        assert [db, dc] == pytest.approx((ahead - behind)[1:3] / (2.0 * h), rel=1e-8)


def test_every_planted_error_in_a_mass_integral_is_noticed() -> None:
    """Each element of the second moments of one member, changed by 1e-4 of itself, is a hundred times what the codes
    differ by without it. Elements that are zero but for rounding have nothing to change."""
    scene = moved(modal_points(scene_of(FLEXIBLE[0])))
    theirs = kinds(engine("native").compile(scene).evaluate())

    def differs(i: int = 0, j: int = 0, factor: float = 1.0) -> float:
        dynamics = KaneDynamics(scene)
        moments = dynamics.data["member_2"].moments
        moments[i, j] *= factor
        moments[j, i] = moments[i, j]
        dynamics._set_bodies()
        state = dynamics.state(0.0, dynamics.initial())
        return apart(kinds(KaneObserver(dynamics).observe(0.0, state)), theirs)

    clean, moments = differs(), KaneDynamics(scene).data["member_2"].moments
    size = np.sqrt(np.diag(moments))
    present = np.abs(moments) > 1e-10 * np.outer(size, size)
    elements = list(zip(*np.nonzero(np.triu(present)), strict=True))
    noticed = {place: differs(*place, 1.0 + 1e-4) for place in elements}
    assert len(elements) > 50 and min(noticed.values()) > 100.0 * clean


def test_a_run_keeps_energy_momentum_and_joints() -> None:
    """The boom for 0.05 s, its members bent at the start: as native, to what the tolerance leaves."""
    scene = replace(moved(modal_points(scene_of(FLEXIBLE[0])), 1e-3), gravity_m_s2=(0.0, 0.0, 0.0))
    run = Run(np.linspace(0.0, 0.05, 5))
    ours = engine("native").compile(scene).simulate(run, Effort("tolerance", 1e-11, "dop853"))
    model = engine("kane").compile(scene)
    theirs = model.simulate(run, Effort("tolerance", 1e-9, "DOP853"))
    assert theirs.status == "finished", theirs.message
    assert ours.work is not None and theirs.work is not None and theirs.momentum is not None
    balance = sum(theirs.energy.values()) - theirs.work
    assert np.ptp(balance) < 1e-7 * np.ptp(theirs.energy["kinetic"])
    assert np.abs(theirs.momentum - theirs.momentum[0]).max() < 1e-7 * np.abs(theirs.momentum).max()
    for name, marker in ours.markers.items():
        assert np.abs(marker.position - theirs.markers[name].position).max() < 1e-8, name
    assert ours.work == pytest.approx(theirs.work, abs=1e-6 * np.abs(ours.work).max())


def changed(scene: s.Scene, **fields: object) -> s.Scene:
    """With another second body, a beam."""
    bodies = list(scene.bodies)
    bodies[1] = replace(bodies[1], **fields)
    return replace(scene, bodies=tuple(bodies))


BOOM = scene_of(FLEXIBLE[0])
MODES = BOOM.bodies[1].modes  # type: ignore[union-attr]
TIP = s.TipMass(x_m=1.5, mass_kg=0.1)
MASS = s.PointMass(name="drop", body="hub", mass_kg=1.0)
PUSH = s.Load(name="push", body="hub", type="force", direction=(1.0, 0.0, 0.0), function=s.Constant(value=1.0))
BALL = s.Spherical(name="ball", parent="ground", child="hub")
LOOP = s.Closure(name="loop", type="spherical", body_a="hub", body_b="instrument")
REFUSED = {
    "torsion": (changed(BOOM, modes=replace(MODES, families=("bending_y", "torsion"))), "families other than bending"),
    "free": (changed(BOOM, modes=replace(MODES, boundary="free-free")), "no clamp"),
    "lumped": (changed(BOOM, mass="lumped"), "lumped mass"),
    "line": (changed(BOOM, points="line"), 'points = "line"'),
    "tip": (changed(BOOM, tip_masses=(TIP,)), "tip masses"),
    "damped": (changed(BOOM, modes=replace(MODES, damping_ratio=0.01)), "damping"),
    "level": (changed(BOOM, level="stiffened"), 'not "stiffened"'),
    "point mass": (replace(BOOM, point_masses=(MASS,)), "make it part of its body"),
    "load": (replace(BOOM, loads=(PUSH,)), 'load "push"'),
    "hinge": (replace(BOOM, hinges=(BALL, *BOOM.hinges[1:])), "welds, revolute and free hinges alone"),
    "closure": (replace(BOOM, closures=(LOOP,)), '"loop"'),
    "rigid": (scene_of(RIGID[0]), "no body of the scene deforms"),
}


@pytest.mark.parametrize(("scene", "words"), REFUSED.values(), ids=REFUSED)
def test_what_it_has_not_is_refused_by_name(scene: s.Scene, words: str) -> None:
    support = KaneEngine().supports(scene)
    assert support.kind == "no" and words in support.reason
    with pytest.raises(ValueError, match=f'scene "{scene.name}"'):
        KaneEngine().compile(scene)


def test_bodies_without_inertia_about_an_axis_are_refused() -> None:
    """Their free bodies would turn at any rate, and a run would not end; beside the line the same masses are taken."""
    hub = next(i for i, body in enumerate(BOOM.bodies) if body.name == "hub")
    slim = replace(BOOM.bodies[hub], inertia_kg_m2=((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    rods = [slim if i == hub else body for i, body in enumerate(BOOM.bodies)]
    assert "no inertia about some axis" in KaneEngine().supports(replace(BOOM, bodies=tuple(rods))).reason
    tree = bending().scene()
    assert KaneEngine().supports(tree).kind == "exact"
    middle = next(body for body in tree.bodies if isinstance(body, s.ModalBody))
    on_a_line = tuple(replace(point, position_m=(point.position_m[0], 0.0, 0.0)) for point in middle.points)
    bodies = tuple(replace(body, points=on_a_line) if body is middle else body for body in tree.bodies)
    assert 'body "middle": undeformed' in KaneEngine().supports(replace(tree, bodies=bodies)).reason


def test_points_with_inertia_of_their_own_are_refused() -> None:
    scene = modal_points(changed(BOOM, points="rotary"))
    assert "massy section points" in KaneEngine().supports(scene).reason


def test_the_canonical_cases_at_level_full_have_the_witness() -> None:
    """Every variant of level full by the sections of a beam, in all the three families."""
    found = [path for path in sorted(Path(CASES).glob("*/*/run.toml")) if "canonical" in path.read_text("utf-8")]
    with_witness = {
        path.parent.relative_to(CASES).as_posix()
        for path in found
        for variant in tomllib.loads(path.read_text("utf-8"))["variant"]
        if "kane" in variant["engines"]
    }
    assert with_witness == {*FLEXIBLE, "spinning_beam/beam_k_subcritical", "spinning_beam/beam_s_supercritical"}
