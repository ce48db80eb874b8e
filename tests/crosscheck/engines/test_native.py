"""The native engines through the contract: routes that must be equal, methods of stiff scenes, controllers, events, and
what each says of a scene.
"""

from dataclasses import replace

import numpy as np
import pytest

import flexmb
import flexmb as fm
from crosscheck.engines.answers import checked_run
from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import Effort, Run, Snapshot, Support, Trajectory
from crosscheck.engines.functions_of_time import profile
from crosscheck.engines.native import NativeEngine, radau5
from crosscheck.engines.registry import engine
from flexmb.run.warm_up import pendulum
from flexmb.scene.build import SceneBuilder
from flexmb.scene.events import EndRun, Impact, SceneEvent
from flexmb.scene.schema import Scene
from tests import trees
from tests.bounds import algebra
from tests.flexmb.control.scenes import rotor
from tests.flexmb.control.test_closed_chains import GRASHOF, LAGGING, controlled
from tests.flexmb.control.test_satellite import craft
from tests.flexmb.frisch.scenes import clamped

RECURSION, FRISCH, PRINT = "native", "native-frisch", "native-frisch-as-printed"
# first-order mass matrices lose definiteness where the deformation is not small
LINEAR = replace(trees.LINEAR, bodies=6, deformation=0.03)
CLAMPED = replace(LINEAR, carriers=("rigid", "modal", "beam"))
SAME = {
    "rigid": replace(trees.RIGID, bodies=6), "ruthless": replace(trees.RUTHLESS, bodies=6), "linear": LINEAR,
    "free-flying": replace(LINEAR, grounded=False, prescribed=False),
}  # fmt: skip


def gaps(ours: Snapshot, theirs: Snapshot) -> dict[str, float]:
    """Largest differences by kind, in units of the kind's largest value."""
    kinds = {
        "motion": [
            (np.r_[a.position, a.velocity, a.acceleration], np.r_[b.position, b.velocity, b.acceleration])
            for a, b in ((ours.markers[name], theirs.markers[name]) for name in ours.markers)
        ],
        "loads": [(ours.loads[name], theirs.loads[name]) for name in ours.loads],
        "wheels": [(ours.wheel_loads[name], theirs.wheel_loads[name]) for name in ours.wheel_loads],
        "drives": [(ours.drives[name], theirs.drives[name]) for name in ours.drives],
        "energy": [(np.array(ours.energy[kind]), np.array(theirs.energy[kind])) for kind in ours.energy],
        "momentum": [(ours.momentum, theirs.momentum)],
    }
    return {kind: _gap(pairs) for kind, pairs in kinds.items() if pairs}


def _gap(pairs: list[tuple[np.ndarray, np.ndarray]]) -> float:
    size = max(float(np.max(np.abs(a))) for a, _ in pairs)
    return max(float(np.max(np.abs(a - b))) for a, b in pairs) / size


def rounding(scene: Scene) -> float:
    """Of two backward-stable solutions: their common backward error times the condition of the mass matrix."""
    system = flexmb.compile(scene)
    points = max(len(link.model.mass) for link in system.links)
    condition = np.linalg.cond(system.mass_matrix(system.initial_state))
    return algebra(system.nu, len(system.body_names), points) * float(condition)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("recipe", SAME)
def test_both_routes_are_equal_to_rounding(recipe, seed):
    """Accelerations, all loads, drives: at every level that Frisch's equations represent exactly."""
    scene = trees.random_scene(seed, SAME[recipe])
    assert engine(FRISCH).supports(scene).kind == "exact"
    found = gaps(engine(RECURSION).compile(scene).evaluate(), engine(FRISCH).compile(scene).evaluate())
    bound = rounding(scene)
    assert bound < 1e-6, "a scene that shows nothing"
    assert max(found.values()) <= bound, found


def test_runs_of_both_routes_agree_within_their_refinement():
    scene = trees.random_scene(1, LINEAR)
    run = Run(np.linspace(0.0, 0.2, 6))
    models = [engine(name).compile(scene) for name in (RECURSION, FRISCH)]
    efforts = (Effort("tolerance", rtol, "dop853") for rtol in (1e-7, 1e-10))
    coarser, finest = ([model.simulate(run, effort) for model in models] for effort in efforts)
    assert all(path.status == "finished" for path in finest), finest[1].message

    def apart(kind: str, ours: Trajectory, theirs: Trajectory) -> float:
        if kind == "markers":
            return max(np.max(np.abs(ours.markers[m].position - theirs.markers[m].position)) for m in ours.markers)
        return max(np.max(np.abs(ours.loads[hinge] - theirs.loads[hinge])) for hinge in ours.loads)

    sizes = {"markers": 1.0, "loads": max(np.max(np.abs(load)) for load in finest[0].loads.values())}  # m; N and Nm
    for kind, size in sizes.items():
        doubt = max(apart(kind, rough, fine) for rough, fine in zip(coarser, finest, strict=True))
        assert doubt < 1e-5 * size
        assert apart(kind, *finest) <= doubt, kind
    assert finest[0].work[-1] == pytest.approx(finest[1].work[-1], rel=1e-6)


def test_each_engine_says_what_it_approximates():
    rigid, linear = (trees.random_scene(0, recipe) for recipe in (SAME["rigid"], CLAMPED))
    full = trees.random_scene(0, replace(CLAMPED, levels=("full",)))
    for scene in (rigid, linear, full):
        assert engine(RECURSION).supports(scene).kind == "exact"
    assert [engine(FRISCH).supports(scene).kind for scene in (rigid, linear, full)] == ["exact", "exact", "surrogate"]
    assert engine(PRINT).supports(rigid).kind == "exact"
    assert "first order" in engine(FRISCH).supports(full).reason


def test_the_print_refuses_modes_that_are_not_clamped_at_the_hinge():
    scene = trees.random_scene(0, replace(LINEAR, carriers=("floating",)))
    support = engine(PRINT).supports(scene)
    assert support.kind == "no"
    assert "clamped" in support.reason and '"b0"' in support.reason
    assert engine(FRISCH).supports(scene).kind == "exact"


def test_frisch_refuses_closed_chains():
    rods = SceneBuilder("double pendulum held at its end")
    for rod in "ab":
        rods.rigid_body(rod, mass=1.0, inertia=(0.1, 0.1, 0.1))
    tree = rods.revolute("first", "ground", "a").revolute("second", "a", "b", parent_position=(1, 0, 0))
    scene = tree.closure("end", "spherical", "ground", "b", position_a=(2, 0, 0), position_b=(1, 0, 0)).scene()
    for name in (FRISCH, PRINT):
        support = engine(name).supports(scene)
        assert support.kind == "no" and "closures" in support.reason


def test_the_print_is_right_on_rigid_bodies_and_wrong_on_flexible_ones():
    """The latter is the negative control of the former: one per cent is what these comparisons would see at once."""
    rigid = trees.random_scene(3, SAME["rigid"])
    found = gaps(engine(RECURSION).compile(rigid).evaluate(), engine(PRINT).compile(rigid).evaluate())
    assert max(found.values()) <= rounding(rigid), found
    flexible = clamped(trees.random_scene(3, CLAMPED))
    support = engine(PRINT).supports(flexible)
    assert support.kind == "surrogate" and "print" in support.reason
    found = gaps(engine(RECURSION).compile(flexible).evaluate(), engine(PRINT).compile(flexible).evaluate())
    assert found["motion"] > 1e-2


def falling(*events: SceneEvent) -> Scene:
    """A ball on a rail that falls through zero at 0.45 s."""
    return (
        SceneBuilder("falling", gravity=(0.0, 0.0, -9.81))
        .rigid_body("ball", mass=1.0, inertia=(0.1, 0.1, 0.1))
        .prismatic("rail", "ground", "ball", axis=(0.0, 0.0, 1.0), position=1.0)
        .add(*events)
        .marker("ball", "ball")
        .scene()
    )


def test_a_run_whose_events_chatter_keeps_the_samples_that_it_was_asked_for():
    """It ends at an event, between two samples, which is one more of its own: caught between a floor and a ceiling."""
    bounce = (Impact(coordinate="rail.translation"),)
    floor = SceneEvent(name="floor", watch="rail.translation", level=0.0, crossing="falling", actions=bounce)
    ceiling = SceneEvent(name="ceiling", watch="rail.translation", level=1e-9, crossing="rising", actions=bounce)
    times, scene = np.linspace(0.0, 1.0, 6), falling(floor, ceiling)
    run = engine(RECURSION).compile(scene).simulate(Run(times), Effort("tolerance", 1e-8, "dop853"))
    assert run.status == "diverged" and "events follow each other" in run.message
    assert checked_run(run, times, scene).times.tolist() == [0.0, 0.2, 0.4]


def test_a_scene_that_ends_its_own_run_is_refused():
    end = SceneEvent(name="over", watch="rail.translation", level=0.0, actions=(EndRun(),))
    support = engine(RECURSION).supports(falling(end))
    assert support.kind == "no" and 'event "over" ends the run' in support.reason


METHODS = {
    "native-radau5": ("tolerance", "radau5"),
    "native-exponential": ("tolerance", "exponential"),
    "native-generalised-alpha": ("step", "generalised_alpha"),
}
RUN = Run(np.linspace(0.0, 0.5, 6))


@pytest.mark.parametrize("name", METHODS)
def test_the_finest_effort_of_each_agrees_with_dop853(name):
    scene, (kind, method) = pendulum(), METHODS[name]
    efforts = engine(name).efforts(scene)
    assert len(efforts) >= 3
    assert {(effort.kind, effort.method) for effort in efforts} == {(kind, method)}
    exact = engine("native").compile(scene).simulate(RUN, Effort("tolerance", 1e-12, "dop853"))
    done = engine(name).compile(scene).simulate(RUN, efforts[-1])
    assert done.status == "finished"
    apart = np.abs(done.markers["centre"].position - exact.markers["centre"].position).max()
    assert apart < (1e-9 if kind == "tolerance" else 1e-6)
    # the method is the effort's, whichever engine runs it
    same = engine("native").compile(scene).simulate(RUN, efforts[-1])
    assert np.array_equal(same.markers["centre"].position, done.markers["centre"].position)


def test_every_method_takes_closures():
    loop = (
        SceneBuilder("loop")
        .rigid_body("rod", mass=1.0, com=(0.5, 0, 0), inertia=(0.1, 0.1, 0.1), nodes={"far": (1.0, 0.0, 0.0)})
        .spherical("ball", "ground", "rod")
        .closure("ring", "spherical", "ground", "rod", position_a=(1.0, 0.0, 0.0), node_b="far")
        .scene()
    )
    for name in METHODS:
        assert engine(name).supports(loop).kind == "exact"


LAW = fm.StateSpace(name="law", inputs=("angle",), D=((-1.0,),))


class Willing:
    """An engine that would take any scene."""

    name = "willing"

    def supports(self, scene: fm.Scene) -> Support:
        return Support("exact")


def test_our_engines_take_controllers_and_one_that_knows_none_refuses_them() -> None:
    refused = CheckedEngine(Willing()).supports(rotor(LAW))  # type: ignore[arg-type]
    assert refused.kind == "no"
    assert all(CheckedEngine(own).supports(rotor(LAW)).kind == "exact" for own in (NativeEngine(), radau5()))
    assert '"law": the adapter of engine willing knows no controllers' in refused.reason
    assert CheckedEngine(Willing()).supports(rotor()).kind == "exact"  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["native-radau5", "native-exponential", "native-generalised-alpha"])
def test_and_those_of_closed_chains(name: str) -> None:
    """They run as by the engine without Jacobians."""
    scene, run = controlled(GRASHOF, "drive", LAGGING), Run(np.linspace(0.0, 0.1, 3))
    assert CheckedEngine(engine(name)).supports(scene).kind == "exact"
    done, exact = (
        engine(each).compile(scene).simulate(run, engine(each).efforts(scene)[-1]) for each in (name, "native")
    )
    assert done.status == exact.status == "finished"
    apart = np.abs(done.markers["joint"].position - exact.markers["joint"].position).max()
    assert apart < (1e-4 if "alpha" in name else 1e-9)


def test_a_signal_is_no_profile() -> None:
    with pytest.raises(NotImplementedError, match="no function of time"):
        profile(fm.ControlSignal(source="law"))


def test_laws_whose_changes_no_record_would_see_are_refused() -> None:
    law = fm.UserLaw(
        name="law", inputs=("angle",), function="tests.flexmb.control.laws:proportional", parameters=(1.0,)
    )
    assert "would not know its changes" in CheckedEngine(NativeEngine()).supports(rotor(law)).reason
    assert CheckedEngine(NativeEngine()).supports(craft().scene()).kind == "exact"


LATCH = fm.SceneEvent(
    name="caught", watch="pivot.rotation", level=-1.0, actions=(fm.Latch(coordinate="pivot.rotation"),)
)


def eventful() -> Scene:
    return fm.SceneBuilder("caught").add(*pendulum().bodies, *pendulum().hinges, *pendulum().markers, LATCH).scene()


@pytest.mark.parametrize("name", ["exudyn", "exudyn-beam", "drake", "opensim"])
def test_these_peers_refuse_scenes_with_events_and_our_own_algorithms_run_them(name: str) -> None:
    for own in ("native", "native-composite", "native-frisch", "native-generalised-alpha"):
        assert CheckedEngine(engine(own)).supports(eventful()).kind == "exact"
    support = CheckedEngine(engine(name)).supports(eventful())
    assert support.kind == "no" and "caught" in support.reason and "knows no events" in support.reason
