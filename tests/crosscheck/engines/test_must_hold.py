"""What the project promises of its engines at random states, pinned on the shipped cases and on random trees.

Rigid variants: accelerations equal Pinocchio's, MuJoCo's and Drake's to 1e-10 and hinge loads to 1e-9. Level `full`:
mass matrix and accelerations equal those of Exudyn's floating frame to 1e-9. Free flight equals Exudyn's explicit run
to 1e-7 (`test_exudyn_flexible.py`).
"""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

import flexmb
from crosscheck.engines.contract import MarkerSnapshot, Snapshot
from crosscheck.engines.registry import engine
from flexmb.scene import schema as s
from flexmb.scene.connectors import sticks
from flexmb.surrogate import finite_segments, modal_points, rigidify
from tests import trees
from tests.crosscheck.engines.peers import taking
from tests.crosscheck.engines.randomise import randomise

# Trees: a random state of a closed chain leaves its closures open. Those are held at a state that closes them, in
# tests/cases/test_closed_chains.py.


ROUNDING = 1e-14
MOST_BODIES = 200  # of a thousand in a row the mass matrix magnifies rounding beyond the tolerances here


def _comparable(path: Path) -> bool:
    """Whether anything moves without its modes, and rounding leaves the digits that are asked for."""
    scene = flexmb.load_scene(path)
    moves = any(not isinstance(hinge, s.Weld) for hinge in scene.hinges)
    apart = scene.closures or scene.couplings or any(map(sticks, scene.connectors))  # peers' friction does not stick
    return moves and not apart and len(scene.bodies) <= MOST_BODIES


CASES = sorted(path for path in (Path(__file__).parents[3] / "cases").glob("*/*/scene.toml") if _comparable(path))
RANDOM = [(name, seed) for name in ("grounded", "free-flying") for seed in range(60, 63)]
ACCELERATION = 1e-10
LOAD = 1e-9
FLEXIBLE = 1e-9


def shipped(path: Path) -> s.Scene:
    """The scene of a case without its controllers: at a state by itself their signals are zero, and peers have none."""
    return flexmb.open_loop(flexmb.load_scene(path))


def largest(motions: list[np.ndarray]) -> float:
    """The largest number; one unit where all are rounding, as of what is at rest or driven: then nothing has a size."""
    found = max(float(np.max(np.abs(motion))) for motion in motions)
    return found if found > ROUNDING else 1.0


def compare_accelerations(ours: dict[str, MarkerSnapshot], theirs: dict[str, MarkerSnapshot], tolerance: float) -> None:
    """Angular and linear parts each in units of the scene's largest."""
    assert ours.keys() == theirs.keys() and ours, "markers are what is compared: a scene without any shows nothing"
    for part in (slice(0, 3), slice(3, 6)):
        scale = largest([marker.acceleration[part] for marker in ours.values()])
        for name, marker in ours.items():
            gap = marker.acceleration[part] - theirs[name].acceleration[part]
            assert np.max(np.abs(gap)) <= tolerance * scale, name


def compare_loads(scene: s.Scene, ours: Snapshot, theirs: Snapshot, tolerance: float) -> None:
    """All six components across every hinge, torques and forces each in units of the scene's largest.

    Inertia forces, m a of all bodies, count as well (and their torques over a metre): across a free hinge they cancel.
    """
    mass = sum(body.mass_kg for body in scene.bodies if isinstance(body, s.RigidBody))
    inertial = mass * largest([marker.acceleration for marker in ours.markers.values()])
    for part in (slice(0, 3), slice(3, 6)):
        scale = max(inertial, largest([load[part] for load in ours.loads.values()]))
        for hinge in scene.hinges:
            gap = ours.loads[hinge.name][part] - theirs.loads[hinge.name][part]
            assert np.max(np.abs(gap)) <= tolerance * scale, hinge.name


def compare_rigid(scene: s.Scene, name: str) -> None:
    ours = engine("native").compile(scene).evaluate()
    theirs = taking(name, scene).compile(scene).evaluate()
    compare_accelerations(ours.markers, theirs.markers, ACCELERATION)
    compare_loads(scene, ours, theirs, LOAD)


# Not Drake: four cases are at rest, where the others give exact zeros and Drake's sums are some 1e-15.
@pytest.mark.parametrize("name", ["pinocchio", "mujoco"])
@pytest.mark.parametrize("path", CASES, ids=lambda path: "/".join(path.parts[-3:-1]))
def test_rigid_variants_of_the_cases(path, name):
    compare_rigid(randomise(rigidify(shipped(path)), np.random.default_rng(0)), name)


@pytest.mark.parametrize("name", ["pinocchio", "mujoco", "drake", "dart", "opensim"])
@pytest.mark.parametrize(("kind", "seed"), RANDOM)
@pytest.mark.filterwarnings("ignore:.*Inertia matrix is too close")
def test_rigid_variants_of_random_flexible_trees(kind, seed, name):
    recipe = trees.FULL if kind == "grounded" else trees.FREE_FLYING
    compare_rigid(rigidify(trees.random_scene(seed, recipe)), name)


@pytest.mark.parametrize("name", ["pinocchio", "mujoco", "drake", "dart", "opensim"])
@pytest.mark.parametrize("seed", range(2))
def test_finite_segments_of_a_beam(seed, name):
    """Sixteen stiff segments: a surrogate is a rigid tree like any other."""
    scene = replace(clamped_beam(), bodies=(beam("clamped-free", ("bending_y", "bending_z", "torsion")),))
    compare_rigid(randomise(finite_segments(scene, "beam", 16), np.random.default_rng(seed)), name)


def beam(boundary: str, families: tuple[str, ...] = ("bending_y", "bending_z", "axial", "torsion")) -> s.BeamBody:
    """Beam K of the spin-up manoeuvre with a torsional stiffness, its section's inertia in massy points."""
    stations = tuple(
        s.BeamStation(
            x_m=x, EA_N=5.03e6, EIy_Nm2=566.6, EIz_Nm2=566.6, GJ_Nm2=435.0, mass_per_length_kg_m=0.2019,
            rotary_y_kg_m=2e-4, rotary_z_kg_m=2e-4,
        )
        for x in (0.0, 8.0)
    )  # fmt: skip
    modes = s.Modes(count=6, families=families, boundary=boundary)
    return s.BeamBody(name="beam", length_m=8.0, elements=8, stations=stations, modes=modes, points="section")


def markers() -> tuple[s.Marker, ...]:
    return (s.Marker(name="tip", body="beam", node="tip"), s.Marker(name="root", body="beam", node="root"))


def clamped_beam() -> s.Scene:
    """On a hinge about a turned axis, under gravity."""
    hinge = s.Revolute(name="hub", parent="ground", child="beam", axis=(0.0, 0.6, 0.8))
    return s.Scene(
        name="clamped", gravity_m_s2=(0.0, 0.0, -9.81), bodies=(beam("clamped-free"),), hinges=(hinge,),
        markers=markers(),
    )  # fmt: skip


def flying_beam(boundary: str) -> s.Scene:
    return s.Scene(
        name="flying", bodies=(beam(boundary),), hinges=(s.Free(name="free", parent="ground", child="beam"),),
        markers=markers(),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("boundary", ["clamped-free", "free-free"])
def test_full_has_the_mass_matrix_of_exudyns_floating_frame(boundary, seed):
    """[modes; angular; linear] in body axes: a free hinge's own speeds, where it sits at the body frame."""
    scene = randomise(modal_points(flying_beam(boundary)), np.random.default_rng(seed))
    theirs = taking("exudyn", scene).compile(scene).mass_matrix("beam")
    system = flexmb.compile(scene)
    free, modes = system.speed("free"), system.speed("beam.modes")
    order = np.r_[modes, free]
    ours = system.mass_matrix(system.initial_state)[np.ix_(order, order)]
    assert np.max(np.abs(ours - theirs)) <= FLEXIBLE * np.max(np.abs(theirs))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("build", [clamped_beam, lambda: flying_beam("clamped-free"), lambda: flying_beam("free-free")],
                         ids=["hinged", "flying, clamped modes", "flying, free modes"])  # fmt: skip
def test_full_has_the_accelerations_of_exudyns_floating_frame(build, seed):
    scene = randomise(modal_points(build()), np.random.default_rng(seed))
    theirs = taking("exudyn", scene).compile(scene).evaluate()
    ours = engine("native").compile(scene).evaluate()
    compare_accelerations(ours.markers, theirs.markers, FLEXIBLE)


@pytest.mark.parametrize("path", CASES, ids=lambda path: "/".join(path.parts[-3:-1]))
def test_flexible_cases_at_random_states(path):
    scene = shipped(path)
    if all(isinstance(body, s.RigidBody) for body in scene.bodies):
        pytest.skip("no flexible body")
    if any(body.level == "exact" for body in scene.bodies):
        pytest.skip("no code but this has beams of strain modes")
    scene = randomise(modal_points(scene), np.random.default_rng(1))
    theirs = taking("exudyn", scene).compile(scene).evaluate()
    compare_accelerations(engine("native").compile(scene).evaluate().markers, theirs.markers, FLEXIBLE)
