"""Derivatives and frequencies: engines agree on random trees within what each says of its own, which bounds the errors
of known problems and is little; answers that the contract does not allow are refused.
"""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from crosscheck.engines.answers import BrokenContract, checked_run
from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import EngineMissing, Run, Trajectory
from crosscheck.engines.linear.coordinates import coordinate_names, modes_of, obstacle, places
from crosscheck.engines.linear.frequencies import eigenfrequencies
from crosscheck.engines.linear.matrices import Errors, LinearMatrices, differentiated, exact, scaled_condition
from crosscheck.engines.linear.parts import DERIVATIVES, FREQUENCIES
from crosscheck.engines.registry import engine
from flexmb.linear.linearize import linearize
from flexmb.linear.variations import Equations
from flexmb.scene.build import SceneBuilder
from flexmb.scene.files import load_scene
from flexmb.scene.functions import Constant
from flexmb.scene.schema import Scene
from flexmb.system.compile import compile
from flexmb.typing import Real
from tests.crosscheck.engines.peers import installed
from tests.crosscheck.engines.random_scenes import KINDS, random_scene
from tests.repo.project import ROOT
from tests.trees import with_armatures

TIMES = np.array([0.0, 1e-6])
KNOWN = {
    "native": 1e-10, "pinocchio": 1e-10, "drake": 1e-10, "mujoco": 1e-5, "native-composite": 1e-5,
    "native-frisch": 1e-5, "opensim": 1e-5,
}  # fmt: skip
"""The largest error of a derivative, relative to its size, that an engine may claim of these well conditioned trees."""
OTHERS = [name for name in KNOWN if name != "native"]
SEEDS = range(4)


@cache
def tree(seed: int, driven: bool, armed: bool = False) -> Scene:
    rng = np.random.default_rng(400 + seed)
    first = "revolute" if driven else "free"
    scene = random_scene(rng, (first, *rng.choice(KINDS[:-1], 5)), driven=driven)
    return with_armatures(scene, seed=seed) if armed else scene


def asked(name: str, scene: Scene) -> Trajectory:
    tried = CheckedEngine(installed(name), duration_s=TIMES[-1])
    support = tried.supports(scene)
    if support.kind != "exact":
        pytest.skip(support.reason)
    run = tried.compile(scene).simulate(Run(TIMES, ("derivatives", "frequencies")), tried.efforts(scene)[-1])
    assert run.status == "finished", run.message
    return run


def agree(name: str, scene: Scene) -> None:
    """In the initial state, which all engines share."""
    ours, theirs = asked("native", scene), asked(name, scene)
    if name == "drake" and not theirs.derivatives:
        pytest.skip("a ball joint has a spring, whose torque the adapter computes beside the plant")
    for part in theirs.derivatives:
        a, b = ours.derivatives[part][0], theirs.derivatives[part][0]
        size, known = np.linalg.norm(a), theirs.known_to[part][0]
        assert known <= KNOWN[name] * size, (part, known, size)
        assert np.linalg.norm(a - b) <= known + ours.known_to[part][0], part
    apart = np.linalg.norm(ours.frequencies[0] - theirs.frequencies[0])
    assert apart <= ours.known_to[FREQUENCIES][0] + theirs.known_to[FREQUENCIES][0]


@pytest.mark.parametrize("name", OTHERS)
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("driven", [False, True], ids=["free", "driven"])
def test_engines_agree_on_random_trees(name: str, seed: int, driven: bool) -> None:
    agree(name, tree(seed, driven))


@pytest.mark.parametrize("name", ["pinocchio", "mujoco", "drake"])
@pytest.mark.parametrize("driven", [False, True], ids=["free", "driven"])
def test_armatures_are_part_of_the_mass_matrix(name: str, driven: bool) -> None:
    agree(name, tree(1, driven, armed=True))


@pytest.mark.parametrize("seed", SEEDS)
def test_the_names_of_coordinates_are_those_of_linear_models(seed: int) -> None:
    scene = tree(seed, driven=seed % 2 == 1)
    own = [name for name, _ in Equations(compile(scene)).labels.displacements]
    names = coordinate_names(scene)
    assert sorted(names) == sorted(own) and len(set(names)) == len(names)
    assert [own[place] for place in places(names, own)] == list(names)
    assert sum(modes_of(body) for body in scene.bodies) == 0 and obstacle(scene) == ""


def test_nothing_is_said_that_was_not_asked() -> None:
    scene = tree(0, driven=False)
    for name in ("native", "pinocchio", "mujoco"):
        tried = CheckedEngine(engine(name), duration_s=TIMES[-1])
        for part in ("derivatives", "frequencies"):
            run = tried.compile(scene).simulate(Run(TIMES, (part,)), tried.efforts(scene)[-1])
            given = set(run.derivatives) | ({FREQUENCIES} if run.frequencies is not None else set())
            assert given == set(run.known_to) == (set(DERIVATIVES) if part == "derivatives" else {FREQUENCIES})
        quiet = tried.compile(scene).simulate(Run(TIMES), tried.efforts(scene)[-1])
        assert not quiet.derivatives and quiet.frequencies is None and not quiet.known_to


@pytest.mark.parametrize("name", ["native", "pinocchio", "mujoco"])
def test_a_scene_without_shared_coordinates_has_no_derivatives(name: str) -> None:
    """Of a closed chain flexmb gives the frequencies alone: here of a pendulum that a closure holds to a line."""
    tree = SceneBuilder("held", gravity=(0.0, -9.81, 0.0)).rigid_body(
        "bar", mass=1.0, com=(0.0, -0.5, 0.0), inertia=(0.1, 0.1, 0.1)
    )
    tree.spherical("pivot", "ground", "bar").marker("bar", "bar")
    tree.closure("hold", "revolute", "ground", "bar", axis=(0.0, 0.0, 1.0))
    scene = tree.scene()
    support = engine(name).supports(scene)
    if support.kind == "no":
        pytest.skip(support.reason)
    run = asked(name, scene)
    assert not run.derivatives
    if name == "native":
        assert run.frequencies[0] == pytest.approx([np.sqrt(9.81 * 0.5 / 0.35)], rel=1e-12)


def test_exudyns_own_linearised_system_lacks_what_loads_of_joints_do():
    """As docs/linearised.md says. Where joints bear no loads it is right: then a new version may have repaired it."""
    assembly = pytest.importorskip("crosscheck.engines.exudyn.assembly")
    shown = {}
    for name in ("hanging_pendulum", "spring_chains"):
        try:
            mbs = assembly.assemble(load_scene(ROOT / "cases" / "linearised" / name / "scene.toml")).shop.mbs
        except EngineMissing as missing:
            pytest.skip(str(missing))
        M, K, *_ = mbs.ComputeLinearizedSystem(projectIntoConstraintNullspace=True)
        shown[name] = np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real)
    chains = linearize(load_scene(ROOT / "cases" / "linearised" / "spring_chains" / "scene.toml"))
    squares = np.sort(np.abs(chains.eigenvalues.imag))[::2] ** 2
    assert shown["spring_chains"] == pytest.approx(squares, rel=1e-6, abs=1e-6)
    assert shown["hanging_pendulum"] == pytest.approx([0.0, 0.0], abs=1e-6)


SMALL = 1e-13


def spd(rng: np.random.Generator, n: int) -> Real:
    A = rng.normal(size=(n, n))
    return A @ A.T + 0.5 * np.eye(n)


def problem(
    M: Real, K: Real, C: Real | None = None, error: float = SMALL, transport: Real | None = None
) -> LinearMatrices:
    """M q'' + C q' + K q = 0, known to `error`."""
    n, inverse = len(M), np.linalg.inv(M)
    inverse = (inverse + inverse.T) / 2.0
    damping = np.zeros((n, n)) if C is None else C
    turning = np.zeros((n, n)) if transport is None else transport
    return LinearMatrices(-inverse @ K, -inverse @ damping, inverse, turning, Errors(error, error, error))


def test_repeated_frequencies_are_as_good_as_others() -> None:
    rng = np.random.default_rng(1)
    M = spd(rng, 5)
    L = np.linalg.cholesky(M)
    Q = np.linalg.qr(rng.normal(size=(5, 5)))[0]
    right = np.array([1.0, 1.0, 3.0, 3.0, 3.0])
    K = L @ Q @ np.diag(right**2) @ Q.T @ L.T
    found, error = eigenfrequencies(problem(M, (K + K.T) / 2.0))
    assert np.linalg.norm(found - right) <= error <= 1e-11


def test_a_rigid_body_motion_is_zero_and_known_to_the_root_of_rounding() -> None:
    M, K = np.diag([1.0, 2.0]), np.array([[8.0, -8.0], [-8.0, 8.0]])
    found, error = eigenfrequencies(problem(M, K))
    assert found == pytest.approx([0.0, np.sqrt(12.0)], abs=1e-13)
    assert 1e-8 < error < 1e-5


def test_nothing_at_all_that_holds_a_body() -> None:
    found, error = eigenfrequencies(problem(np.eye(2), np.zeros((2, 2)), error=0.0))
    assert np.array_equal(found, [0.0, 0.0]) and error == 0.0


def test_damping_lowers_a_frequency_and_beyond_the_critical_one_there_is_none() -> None:
    K, C = np.diag([4.0, 9.0]), np.diag([1.0, 20.0])
    found, error = eigenfrequencies(problem(np.eye(2), K, C))
    assert found == pytest.approx([0.0, np.sqrt(4.0 - 0.25)], abs=1e-12) and error < 1e-6


def test_a_critically_damped_motion_is_known_to_the_root() -> None:
    """Its double eigenvalue is defective: rounding splits it into a pair that oscillates."""
    found, error = eigenfrequencies(problem(np.eye(1), np.array([[4.0]]), np.array([[4.0]])))
    assert found[0] <= error < 1e-5


def test_gyroscopic_terms_part_a_repeated_frequency() -> None:
    """q'' + g J q' + k q = 0 with J skew has w = sqrt(k + g^2/4) +- g/2."""
    g, k = 0.6, 5.0
    C = g * np.array([[0.0, 1.0], [-1.0, 0.0]])
    found, error = eigenfrequencies(problem(np.eye(2), k * np.eye(2), C))
    right = np.sqrt(k + g**2 / 4.0) + np.array([-g, g]) / 2.0
    assert np.linalg.norm(found - right) <= error <= 1e-11


def test_axes_that_turn_shift_frequencies() -> None:
    """Small motion about a fixed point, with k = 5, in axes that turn by 0.4 about the third: xi' = du - w x xi."""
    turn = 0.4 * np.array([[0.0, 1.0], [-1.0, 0.0]])
    found, error = eigenfrequencies(problem(np.eye(2), 5.0 * np.eye(2), -turn, transport=turn))
    right = np.sqrt(5.0) + np.array([-0.4, 0.4])
    assert np.linalg.norm(found - right) <= error <= 1e-11


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("damped", [False, True], ids=["undamped", "damped"])
def test_matrices_within_their_errors_have_frequencies_within_theirs(seed: int, damped: bool) -> None:
    rng, error = np.random.default_rng(seed), 1e-9
    n = 4
    M, K = spd(rng, n), spd(rng, n)
    C = 0.3 * spd(rng, n) + (lambda A: A - A.T)(rng.normal(size=(n, n))) if damped else None
    true = problem(M, K, C, error)
    right, known = eigenfrequencies(true)
    for _ in range(5):
        change, other = rng.normal(size=(2, n, n))
        if not damped:  # as symmetric as a stiffness is
            change = true.by_force @ (change + change.T)
        moved = LinearMatrices(
            true.by_displacement + error * change / np.linalg.norm(change),
            true.by_speed + (error * other / np.linalg.norm(other) if damped else 0.0),
            true.by_force, true.transport, true.errors,
        )  # fmt: skip
        found, _ = eigenfrequencies(moved)
        assert np.linalg.norm(found - right) <= known <= 1e-6


def test_singular_masses_leave_nothing_known() -> None:
    by_force = np.diag([1.0, -1.0])
    at = exact(np.eye(2), np.eye(2), by_force, np.zeros((2, 2)), np.zeros(2), np.zeros(2))
    assert all(np.isinf(each) for each in (at.errors.by_displacement, at.errors.by_speed, at.errors.by_force))
    found, error = eigenfrequencies(at)
    assert np.array_equal(found, [0.0, 0.0]) and error == np.inf
    assert scaled_condition(np.zeros((2, 2))) == np.inf and scaled_condition(np.full((2, 2), np.nan)) == np.inf


def test_units_do_not_change_the_condition_number() -> None:
    M, scale = spd(np.random.default_rng(2), 4), np.array([1e-6, 1.0, 1e3, 1e8])
    assert scaled_condition(M * np.outer(scale, scale)) == pytest.approx(scaled_condition(M), rel=1e-9)


@pytest.mark.parametrize("rate", [1.0, 20.0, 150.0])
def test_differences_know_their_error(rate: float) -> None:
    """At 150 rad/s a step of 1e-3 is coarse, and the error says so."""

    def f(x: Real) -> Real:
        return np.array([np.sin(rate * x[0]) + np.exp(x[1]), np.cos(rate * x[0]) * (1.0 + x[1])])

    found, error = differentiated(f, 2, 1e-16)
    right = np.array([[rate, 1.0], [0.0, 1.0]])
    assert np.linalg.norm(found - right) <= error <= 1e-2 * rate


def test_differences_of_a_polynomial_are_exact_up_to_noise() -> None:
    noise = 1e-12
    rng = np.random.default_rng(3)
    found, error = differentiated(lambda x: x**4 + 3.0 * x + noise * rng.uniform(-1.0, 1.0, 1), 1, noise)
    assert abs(found[0, 0] - 3.0) <= error <= 1e-8


THREE = np.array([0.0, 0.5, 1.0])


def scene(closed: bool = False) -> Scene:
    tree = SceneBuilder("arm", gravity=(0.0, 0.0, -9.81))
    for name, parent in (("upper", "ground"), ("lower", "upper"), ("tool", "lower")):
        tree.rigid_body(name, mass=1.0, inertia=(0.1, 0.1, 0.1))
        driven = {"prescribed": Constant(value=0.1)} if name == "lower" else {}
        tree.revolute(f"to {name}", parent, name, axis=(0.0, 1.0, 0.0), **driven)
    if closed:
        tree.closure("loop", "spherical", "ground", "tool")
    return tree.marker("tool", "tool").scene()


def answer(**change: Any) -> Trajectory:
    given: dict[str, Any] = {
        "derivatives": {name: np.ones((3, 4)) for name in DERIVATIVES},
        "frequencies": np.tile([0.0, 2.0], (3, 1)),
        "known_to": dict.fromkeys((*DERIVATIVES, FREQUENCIES), np.full(3, 1e-12)),
    }
    return Trajectory("finished", "", THREE, {}, **(given | change))


def test_a_sound_answer_is_kept_as_it_is() -> None:
    found = checked_run(answer(), THREE, scene())
    assert all(np.array_equal(found.derivatives[name], np.ones((3, 4))) for name in DERIVATIVES)
    assert coordinate_names(scene()) == ("to upper.rotation", "to tool.rotation")


def test_an_engine_may_say_that_it_does_not_know() -> None:
    unsure = answer().known_to | {"by_speed": np.array([1e-12, np.inf, np.inf])}
    assert np.isinf(checked_run(replace(answer(), known_to=unsure), THREE, scene()).known_to["by_speed"][1:]).all()


SAID = answer().known_to
WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "another name": ({"derivatives": {"by_time": np.ones((3, 4))}}, "derivatives has 'by_time'"),
    "another size": ({"derivatives": answer().derivatives | {"by_speed": np.ones((3, 9))}}, "4 belong to the"),
    "a matrix a sample": ({"derivatives": answer().derivatives | {"by_speed": np.ones((3, 2, 2))}}, "has shape"),
    "no number": ({"derivatives": answer().derivatives | {"by_force": np.full((3, 4), np.nan)}}, "is not finite"),
    "no error": ({"known_to": {name: SAID[name] for name in DERIVATIVES}}, "see frequencies"),
    "an error of nothing": ({"frequencies": None}, "see frequencies"),
    "a negative error": ({"known_to": SAID | {"by_force": np.array([0.0, -1e-9, 0.0])}}, "negative number or none"),
    "an error that is none": ({"known_to": SAID | {"by_force": np.array([0.0, np.nan, 0.0])}}, "negative number or"),
    "falling": ({"frequencies": np.tile([2.0, 1.0], (3, 1))}, "do not rise"),
    "negative": ({"frequencies": np.tile([-2.0, 1.0], (3, 1))}, "negative ones"),
    "too many": ({"frequencies": np.tile([0.0, 1.0, 2.0], (3, 1))}, "frequencies has 3 columns"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_wrong_is_refused(wrong: str) -> None:
    change, reason = WRONG[wrong]
    with pytest.raises(BrokenContract) as refused:
        checked_run(answer(**change), THREE, scene())
    assert reason in str(refused.value)


def test_derivatives_of_a_closed_chain_are_refused_and_its_frequencies_are_not() -> None:
    closed = scene(closed=True)
    assert obstacle(closed) == '"loop": displacements of a closed chain depend on each other'
    with pytest.raises(BrokenContract, match="without shared coordinates"):
        checked_run(answer(), THREE, closed)
    alone = answer(derivatives={}, frequencies=np.ones((3, 1)), known_to={FREQUENCIES: np.zeros(3)})
    assert checked_run(alone, THREE, closed).frequencies is not None
