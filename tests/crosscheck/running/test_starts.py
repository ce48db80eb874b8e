"""Scenes before they run: equilibria, in which nothing accelerates in any engine; loads that the motion leaves open, by
the dense route; and doubtful ones, which run with a warning or, strictly, not at all.
"""

from pathlib import Path

import msgspec
import numpy as np
import pytest

import flexmb
from crosscheck.cli.common import sole_writer
from crosscheck.engines.openness import LOAD_PARTS, NOTHING_OPEN, Openness
from crosscheck.engines.registry import engine
from crosscheck.library.find import Case, load_case, shipped_folder
from crosscheck.library.reference import scene_digest
from crosscheck.running import starts
from crosscheck.running.plan import plan, variant_scene
from crosscheck.running.starts import at_rest
from crosscheck.running.undetermined import undetermined
from flexmb.linear.equations import equations_of
from flexmb.linear.newton import corrected
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder, linear
from flexmb.scene.files import load_scene
from flexmb.scene.functions import Constant, Sine
from flexmb.scene.problems import SceneWarning
from flexmb.scene.schema import Scene
from flexmb.surrogate import modal_points
from tests.crosscheck.sessions import PROVIDER, copy_case
from tests.flexmb.closure import mechanisms
from tests.flexmb.closure.loops import random_loops
from tests.flexmb.closure.test_redundant_and_null import can_move, pendulum
from tests.flexmb.surrogate.beams import beam_scene


def held(function: Constant | Sine) -> Scene:
    """A ball joint with a spring, a point mass on a spring, and a wheel, under gravity and a load."""
    tree = SceneBuilder("held", gravity=(1.0, -2.0, -9.0))
    tree.rigid_body("arm", mass=1.5, com=(0.3, 0.1, 0.0), inertia=(0.05, 0.08, 0.07))
    tree.spherical(
        "ball", "ground", "arm", stiffness=40.0, quaternion=(0.8, 0.0, 0.6, 0.0), angular_velocity=(1.0, 0.0, 2.0)
    )
    spring = linear(stiffness=300.0, damping=1.0, rate=0.7)
    along = ((0.0, 0.6, 0.8),)
    tree.point_mass("bob", "arm", mass=0.2, offset=(0.4, 0.0, 0.0), directions=along, coordinates=(spring,))
    moments = {"axial_inertia": 0.01, "transverse_inertia": 0.006}
    tree.wheel("wheel", "arm", axis=(0.0, 0.0, 1.0), mass=0.3, speed=0.0, angle=0.4, **moments)
    tree.force("push", "arm", node="origin", direction=(0.0, 1.0, 0.0), function=function)
    return tree.marker("arm", "arm", offset=(0.5, 0.0, 0.0)).scene()


@pytest.mark.parametrize("name", ["native", "pinocchio", "mujoco"])
def test_nothing_accelerates_in_the_equilibrium(name: str) -> None:
    scene = at_rest(held(Constant(value=2.0)))
    found = engine(name).compile(scene).evaluate()
    marker = found.markers["arm"]
    assert np.abs(marker.velocity).max() == 0.0
    assert np.abs(marker.acceleration).max() <= 1e-9
    before = engine(name).compile(held(Constant(value=2.0))).evaluate().markers["arm"]
    assert np.abs(before.acceleration).max() > 1.0  # the scene itself is far from it
    assert scene.wheels[0].angle_rad == pytest.approx(0.4)  # it has no spring, and stays


def test_a_flexible_body_sags() -> None:
    scene = modal_points(beam_scene())
    scene = msgspec.structs.replace(scene, gravity_m_s2=(0.0, 0.0, -0.3))
    resting = at_rest(scene)
    assert any(abs(value) > 0.0 for state in resting.modal_states for value in state.coordinates)
    markers = engine("native").compile(resting).evaluate().markers
    assert max(np.abs(marker.acceleration).max() for marker in markers.values()) <= 1e-7


def test_what_changes_with_time_does_not_rest() -> None:
    with pytest.raises(ValueError, match='"push" changes with time'):
        at_rest(held(Sine(amplitude=1.0, angular_frequency_rad_s=2.0)))


def test_a_body_that_falls_has_no_equilibrium() -> None:
    tree = SceneBuilder("falling", gravity=(0.0, 0.0, -9.81)).rigid_body("body", mass=1.0, inertia=(0.1, 0.1, 0.1))
    with pytest.raises(ValueError, match="equilibrium"):
        at_rest(tree.free("flight", "ground", "body").marker("body", "body").scene())


def test_a_start_at_rest_is_there_to_rounding() -> None:
    """Newton's method ends where its next correction is below 1e-12, which is more than the references are known to."""
    case = load_case(shipped_folder() / "linearised" / "sagging_arm")
    scene = case.scene(case.run.variants[0])

    def left(start: flexmb.State) -> float:
        """The correction (rad, m) that Newton's method would make."""
        held = equations_of(system).held(0.0)
        there = corrected(held, held.forces(start))
        return float(np.abs(there.q - start.q).max())

    system = flexmb.compile(at_rest(scene))
    assert left(system.initial_state) < 1e-16
    assert left(flexmb.equilibrium(scene)) > 1e-15


def test_a_variant_in_its_equilibrium_is_another_model_and_a_fault_has_its_own() -> None:
    case = load_case(shipped_folder() / "linearised" / "sagging_arm")
    variant = case.run.variants[0]
    plain = msgspec.structs.replace(variant, start=msgspec.UNSET)
    assert scene_digest(case, variant) != scene_digest(case, plain)
    assert variant_scene(case.scene(plain), plain) == case.scene(plain)
    _, jobs = plan(case, (), "none:none")
    elbows = {job.role: next(hinge for hinge in job.scene.hinges if hinge.name == "elbow").rotation for job in jobs}
    angles = {role: rotation.angle_rad for role, rotation in elbows.items()}
    assert len({round(angle, 9) for angle in angles.values()}) == len(angles)
    assert all(rotation.rate_rad_s == 0.0 for rotation in elbows.values())


def latched(scene: s.Scene) -> s.Scene:
    """Crank and rocker are both latched at 0.1 s: then one of them would do."""
    stops = tuple(s.Latch(coordinate=f"{hinge}.rotation") for hinge in ("drive", "pivot"))
    return msgspec.structs.replace(scene, events=(s.SceneEvent(name="stop", watch="time", level=0.1, actions=stops),))


def docked(scene: s.Scene) -> s.Scene:
    """A second pin beside the first one closes at 0.1 s: how they share the force is open from then on."""
    spare = msgspec.structs.replace(scene.closures[0], name="spare", closed=False)
    docks = s.Dock(closure="spare", tolerance_m=1e-6, tolerance_rad=1e-6)
    event = s.SceneEvent(name="stop", watch="time", level=0.1, actions=(docks,))
    return msgspec.structs.replace(scene, closures=(*scene.closures, spare), events=(event,))


DETERMINED = load_scene(Path(__file__).parents[3] / "cases" / "closed_chains" / "four_bar" / "scene.toml")
SCENES = {
    "plane": mechanisms.four_bar(), "determined": DETERMINED, "flexible": mechanisms.four_bar(modes=2),
    "driven": pendulum("weld", driven=s.Constant(value=0.0)), "latched": latched(DETERMINED),
    "docked": docked(DETERMINED),
}  # fmt: skip


def by_run(scene: s.Scene) -> Openness:
    run = flexmb.simulate(scene, 0.2, samples=9, rtol=1e-8, atol=1e-10)
    found = []
    for name, is_open in run.undetermined.items():
        if name.endswith(".drive") and name not in run.loads:
            found.append((f"drive:{name.removesuffix('.drive')}", is_open))
        else:
            found += [(f"load:{name}.{part}", is_open[place]) for part, place in LOAD_PARTS.items()]
    return Openness.of_flags(found)


@pytest.mark.parametrize("name", SCENES)
def test_what_is_open_is_what_the_run_finds_open(name):
    found = undetermined(SCENES[name], 0.2)
    assert found == by_run(SCENES[name])
    assert bool(found) == (name in ("plane", "driven", "latched", "docked"))


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_components_of_random_loops(seed):
    """By the rank of dense rows in the harness, and by what our engine gives as NaN."""
    scene = random_loops(seed)
    if not can_move(scene):
        return
    system = flexmb.compile(scene)
    state = system.initial_state
    evaluation = system.evaluate(state.t, state.q, state.u)
    flags = [(f"load:{name}.{part}", np.isnan(load[place])) for name, load in evaluation.loads.items()
             for part, place in LOAD_PARTS.items()]  # fmt: skip
    flags += [(f"drive:{name}", np.isnan(load)) for name, load in evaluation.drives.items()]
    assert undetermined(scene) == Openness.of_flags(flags)


@pytest.mark.parametrize("name", ["latched", "docked"])
def test_a_latch_or_a_second_pin_opens_nothing_before_it_happens(name):
    assert undetermined(SCENES[name], 0.05) == NOTHING_OPEN == undetermined(SCENES[name])


def test_a_tree_has_none():
    assert undetermined(msgspec.structs.replace(SCENES["plane"], closures=()), 1.0) == NOTHING_OPEN


@pytest.fixture
def doubtful(tmp_path: Path) -> Case:
    """The small case with a damper that drives."""
    folder = copy_case(tmp_path)
    scene = folder / "scene.toml"
    text = scene.read_text(encoding="utf-8")
    assert text.count('type = "revolute"') + text.count('kind = "revolute"') == 1
    line = next(line for line in text.splitlines() if '"revolute"' in line)
    scene.write_text(text.replace(line, f"{line}\nrotation = {{ damping_Nms_rad = -0.01 }}"), encoding="utf-8")
    return load_case(folder)


def test_it_is_planned_with_a_warning(doubtful: Case) -> None:
    with pytest.warns(SceneWarning, match="negative damping"):
        _, jobs = plan(doubtful, (), PROVIDER)
    assert jobs and all(not job.error for job in jobs)


@pytest.mark.filterwarnings("default")  # what a command warns of is printed, no error
def test_strictly_its_runs_are_errors(doubtful: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with sole_writer(tmp_path / "strict", strict=True):
        _, jobs = plan(doubtful, (), PROVIDER)
    main = [job for job in jobs if job.role == "main"]
    assert main and all("negative damping" in job.error and job.scene is None for job in main)
    with sole_writer(tmp_path / "lenient"):
        plan(doubtful, (), PROVIDER)
        plan(doubtful, (), PROVIDER, films=True)
    assert capsys.readouterr().err.count("warning: ") == 1


def test_faults_whose_start_contradicts_what_they_couple_are_run_strictly_too(tmp_path: Path) -> None:
    case = load_case(shipped_folder() / "closed_chains" / "geared_hoist")
    with sole_writer(tmp_path, strict=True):
        _, jobs = plan(case, (), PROVIDER)
    faults = [job for job in jobs if job.role.startswith("control:")]
    assert faults and not [job.error for job in faults if job.error]


def rough_linkage(off: float) -> Scene:
    """A four-bar with a gear, whose crank's angle and rate are given; others are `off` (rad), and without rates."""
    tree = SceneBuilder("linkage", gravity=(0.0, -9.81, 0.0))
    for name, length in (("crank", 0.4), ("coupler", 1.0), ("rocker", 0.7)):
        moments = (1e-3, length**3 / 12.0, length**3 / 12.0)
        tree.rigid_body(name, mass=1.0, com=(0.5 * length, 0.0, 0.0), inertia=moments, nodes={"e": (length, 0.0, 0.0)})
    tree.rigid_body("gear", mass=0.2, inertia=(1e-3, 1e-3, 1e-3))
    tree.revolute("A", "ground", "crank", angle=1.0, rate=2.0, given=True)
    tree.revolute("B", "crank", "coupler", parent_node="e", angle=-0.63)
    tree.revolute("C", "ground", "rocker", parent_position=(1.1, 0.0, 0.0), angle=1.5016 + off)
    tree.revolute("G", "ground", "gear", angle=0.5 + off)
    tree.closure("D", "spherical", "coupler", "rocker", node_a="e", node_b="e")
    tree.coupling("mesh", "G", {"A": 0.5})
    return tree.marker("m", "coupler").marker("gear", "gear").scene()


def test_every_engine_gets_the_closed_start() -> None:
    """Pinocchio and MuJoCo begin where flexmb does; before, they began at the values as written, and all differed."""
    scene = rough_linkage(1e-3)
    system = flexmb.compile(scene)
    start = system.initial_state
    there = system.evaluate(start.t, start.q, start.u).markers
    begun = starts.closed(scene)
    assert begun.hinges[0] == scene.hinges[0]  # what is given is kept
    for name in ("pinocchio", "mujoco"):
        own = msgspec.structs.replace(begun, closures=(), couplings=())
        found = engine(name).compile(own).evaluate().markers
        for marker, ours in there.items():
            assert np.abs(found[marker].position - ours.position).max() <= 1e-14
            assert np.abs(found[marker].velocity - ours.velocity).max() <= 1e-13
    apart = engine("pinocchio").compile(msgspec.structs.replace(scene, closures=(), couplings=())).evaluate().markers
    assert np.abs(apart["m"].velocity - there["m"].velocity).max() > 1e-2


def test_a_closed_start_is_left_as_it_is() -> None:
    begun = starts.closed(rough_linkage(1e-3))
    assert starts.closed(begun) is begun
    tree = held(Constant(value=1.0))
    assert starts.closed(tree) is tree


def test_a_start_that_nothing_closes_is_left_to_the_engines() -> None:
    scene = rough_linkage(1e-3)
    far = msgspec.structs.replace(scene.hinges[2], parent_position_m=(9.0, 0.0, 0.0))
    scene = msgspec.structs.replace(scene, hinges=(*scene.hinges[:2], far, scene.hinges[3]))
    assert starts.closed(scene) is scene
