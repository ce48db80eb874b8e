"""What the contract's check says of each breach, and what it passes: every part, kind and edge of an answer."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from crosscheck.engines.answers import (
    LARGEST_COUNT,
    LONGEST_TEXT,
    UNIT,
    BrokenContract,
    checked_ladder,
    checked_model,
    checked_run,
    checked_support,
    checked_version,
    clean,
)  # fmt: skip
from crosscheck.engines.contract import Effort, MarkerPath, Support, Trajectory
from flexmb.run.channels import channels_of
from flexmb.scene.schema import Scene
from tests.crosscheck.engines.test_answers import SCENE as PENDULUM
from tests.crosscheck.fake_engines import STEPS, TOLERANCES, Pendulum

T = 11
TIMES = np.linspace(0.0, 1.0, T)
NAMES = {
    "hinges": "pivot", "wheels": "wheel", "closures": "loop", "point_masses": "bob", "markers": "tip",
    "connectors": "spring", "total_loads": "sum",
}  # fmt: skip
OWN = {kind: [SimpleNamespace(name=name)] for kind, name in NAMES.items()}
SCENE = cast(Scene, SimpleNamespace(**OWN, constraints=OWN["closures"]))
STEP = Effort("step", 0.5, "rk4")


def numbers(*width: int) -> np.ndarray:
    return np.random.default_rng(sum(width)).normal(size=(T, *width))


TURNS = numbers(4) / np.linalg.norm(numbers(4), axis=1, keepdims=True)
TIP = MarkerPath(numbers(3), TURNS, numbers(6))
GOOD = Trajectory(
    status="finished", message="fine", times=TIMES, markers={"tip": TIP},
    loads={"pivot": numbers(6), "loop": -numbers(6), "bob": 2.0 * numbers(6)}, total_loads={"sum": 6.0 * numbers(6)},
    wheel_loads={"wheel": 3.0 * numbers(6)},
    drives={"pivot": numbers(2), "wheel": numbers(1)}, hinge_forces={"spring": 4.0 * numbers(1)},
    energy={kind: place + numbers() for place, kind in enumerate(("kinetic", "strain", "spring", "gravity"))},
    momentum=5.0 * numbers(6), work=7.0 * numbers(), wall_s=0.25, evaluations=123,
    steps=45, operations=678,
)  # fmt: skip


def arrays(run: Trajectory) -> dict[str, np.ndarray]:
    """Every array of a run, by its place."""
    found = channels_of(run) if len(run.times) else {}
    return found | {"times": run.times}


def test_a_sound_run_passes_whole_in_arrays_of_its_own() -> None:
    run = checked_run(GOOD, TIMES, SCENE)
    assert (run.status, run.message, run.wall_s, run.evaluations) == ("finished", "fine", 0.25, 123)
    assert (run.steps, run.operations) == (45, 678)
    given, found = arrays(GOOD), arrays(run)
    assert found.keys() == given.keys() and len(found) == 26
    for name, values in given.items():
        assert np.array_equal(found[name], values)
        assert not np.shares_memory(found[name], values)
    assert not np.shares_memory(run.times, TIMES)


def test_what_an_engine_does_not_know_may_be_left_out() -> None:
    for status in ("finished", "diverged"):
        bare = Trajectory(status, "why", TIMES, {})
        run = checked_run(bare, TIMES, SCENE)
        assert (run.status, run.markers, run.loads, run.wheel_loads) == (status, {}, {}, {})
        assert (run.drives, run.energy, run.momentum, run.work, run.evaluations) == ({}, {}, None, None, 0)
    lost = replace(GOOD, status="diverged", momentum=None, work=None, energy={"kinetic": np.full(T, np.inf)})
    run = checked_run(lost, TIMES, SCENE)
    assert (len(run.times), run.momentum, run.work) == (0, None, None)


@pytest.mark.parametrize("status", ["diverged", "failed"])
def test_an_unfinished_run_is_cut_in_all_its_parts(status: Any) -> None:
    spoilt = numbers()
    spoilt[4] = np.nan
    run = checked_run(replace(GOOD, status=status, work=spoilt), TIMES, SCENE)
    found, given = arrays(run), arrays(replace(GOOD, work=spoilt))
    assert found.keys() == given.keys()
    for name, values in given.items():
        assert np.array_equal(found[name], values[:4])
    assert (run.status, run.message, run.evaluations) == (status, "fine", 123)
    early = replace(GOOD, status=status, energy={"kinetic": spoilt, "gravity": np.append(numbers()[:9], [np.inf] * 2)})
    assert len(checked_run(early, TIMES, SCENE).times) == 4


def test_real_numbers_of_other_kinds_become_float64_in_rows() -> None:
    whole = np.asfortranarray(np.arange(6 * T).reshape(T, 6), dtype=np.int32)
    run = checked_run(replace(GOOD, momentum=whole, work=numbers().astype(np.float32)), TIMES, SCENE)
    assert run.momentum is not None and run.work is not None
    assert np.array_equal(run.momentum, whole)
    assert run.momentum.flags.c_contiguous and run.momentum.dtype == run.work.dtype == np.float64
    subclass = checked_run(replace(GOOD, work=numbers().view(type("Odd", (np.ndarray,), {}))), TIMES, SCENE)
    assert type(subclass.work) is np.ndarray
    unsigned = checked_run(replace(GOOD, work=np.arange(T, dtype=np.uint8)), TIMES, SCENE)
    assert unsigned.work is not None and unsigned.work[-1] == T - 1


def spoilt(values: np.ndarray, at: int = 3) -> np.ndarray:
    values = values.copy()
    values[at, ...] = np.nan
    return values


def turned(factor: float) -> dict[str, MarkerPath]:
    """The marker with one quaternion longer by that factor."""
    quaternion = TURNS.copy()
    quaternion[3] *= factor
    return {"tip": replace(TIP, quaternion=quaternion)}


FINITE = "is not finite at t = 0.3 s, and the status is finished"
BREACHES: list[tuple[dict[str, Any], str]] = [
    ({"status": "done"}, "the status is 'done': it is one of finished, diverged, failed"),
    ({"status": None}, "the status is None: it is one of finished, diverged, failed"),
    ({"message": None}, "message is None, not text"),
    ({"status": "diverged", "message": " "}, 'a "diverged" run says in its message when and why'),
    ({"times": None}, "times is None and not an array (T,)"),
    ({"times": list(TIMES)}, "times is a list and not an array (T,)"),
    ({"times": TIMES[:, None]}, "times is a ndarray and not an array (T,)"),
    ({"times": TIMES + 0j}, "times is of dtype complex128, not of real numbers"),
    ({"times": np.append(TIMES, 1.1)}, "times has 12 samples, more than the 11 asked for"),
    ({"times": TIMES + 1.0}, "times[0] is 1 s where 0 s was asked for"),
    ({"times": np.array([*TIMES[:-1], 2.0])}, "times[10] is 2 s where 1 s was asked for"),
    ({"times": np.array([*TIMES[:-1], np.nan])}, "times[10] is nan s where 1 s was asked for"),
    ({"times": TIMES[:5]}, "ended at t = 0.4 s of 1 s and called it done"),
    ({"times": TIMES[:0]}, "ended before its first sample of 1 s and called it done"),
    ({"markers": None}, "markers is None, not a mapping"),
    ({"markers": {"top": TIP}}, "markers has 'top', and the scene has tip"),
    ({"markers": {"tip": None}}, "markers['tip'] returned None, not a MarkerPath"),
    ({"markers": {"tip": replace(TIP, position=numbers(2))}}, "markers['tip'].position has shape (11, 2); (11, 3)"),
    ({"markers": {"tip": replace(TIP, quaternion=numbers(3))}}, "markers['tip'].quaternion has shape (11, 3); (11, 4)"),
    ({"markers": {"tip": replace(TIP, velocity=numbers(3))}}, "markers['tip'].velocity has shape (11, 3); (11, 6)"),
    ({"markers": {"tip": replace(TIP, position=spoilt(TIP.position))}}, f"markers['tip'].position {FINITE}"),
    ({"markers": {"tip": replace(TIP, quaternion=spoilt(TURNS))}}, f"markers['tip'].quaternion {FINITE}"),
    ({"markers": {"tip": replace(TIP, velocity=spoilt(TIP.velocity))}}, f"markers['tip'].velocity {FINITE}"),
    (
        {"markers": turned(1.5)},
        "markers['tip'].quaternion at t = 0.3 s has norm 1.5 or its inverse: rotations are unit",
    ),
    (
        {"markers": turned(0.5)},
        "markers['tip'].quaternion at t = 0.3 s has norm 1.5 or its inverse: rotations are unit",
    ),
    ({"loads": []}, "loads is a list, not a mapping"),
    ({"loads": {"wheel": numbers(6)}}, "loads has 'wheel', and the scene has bob, loop, pivot"),
    ({"loads": {0: numbers(6)}}, "loads has 0, and the scene has bob, loop, pivot"),
    ({"loads": {"pivot": numbers(3)}}, "loads['pivot'] has shape (11, 3); (11, 6) was expected"),
    ({"loads": {"pivot": numbers(6)[:10]}}, "loads['pivot'] has shape (10, 6); (11, 6) was expected"),
    ({"loads": {"pivot": spoilt(numbers(6))}}, f"loads['pivot'] {FINITE}"),
    ({"wheel_loads": None}, "wheel_loads is None, not a mapping"),
    ({"wheel_loads": {"pivot": numbers(6)}}, "wheel_loads has 'pivot', and the scene has wheel"),
    ({"wheel_loads": {"wheel": numbers(5)}}, "wheel_loads['wheel'] has shape (11, 5); (11, 6) was expected"),
    ({"wheel_loads": {"wheel": spoilt(numbers(6))}}, f"wheel_loads['wheel'] {FINITE}"),
    ({"drives": None}, "drives is None, not a mapping"),
    ({"drives": {"loop": numbers(1)}}, "drives has 'loop', and the scene has bob, pivot, wheel"),
    ({"drives": {"pivot": numbers()}}, "drives['pivot'] has shape (11,); (11, n) was expected"),
    ({"drives": {"pivot": numbers(0)}}, "drives['pivot'] has shape (11, 0); (11, n) was expected"),
    ({"drives": {"pivot": np.array(1.0)}}, "drives['pivot'] has shape (); (11, n) was expected"),
    ({"drives": {"pivot": spoilt(numbers(2))}}, f"drives['pivot'] {FINITE}"),
    ({"connectors": {"spring": numbers(6)}}, "connectors has 'spring', and the scene has none"),
    ({"hinge_forces": {"pivot": numbers(1)}}, "hinge_forces has 'pivot', and the scene has spring"),
    ({"energy": None}, "energy is None, not a mapping"),
    ({"energy": {"heat": numbers()}}, "energy has 'heat', and the scene has gravity, kinetic, spring, strain"),
    ({"energy": {"spring": numbers(1)}}, "energy['spring'] has shape (11, 1); (11,) was expected"),
    ({"energy": {"strain": spoilt(numbers())}}, f"energy['strain'] {FINITE}"),
    ({"momentum": [1.0]}, "momentum is a list, not an array"),
    ({"momentum": np.ma.masked_array(numbers(6))}, "momentum is a MaskedArray, not an array"),
    ({"momentum": numbers(6).astype(object)}, "momentum is of dtype object, not of real numbers"),
    ({"momentum": numbers(6) > 0.0}, "momentum is of dtype bool, not of real numbers"),
    ({"momentum": numbers(3)}, "momentum has shape (11, 3); (11, 6) was expected"),
    ({"momentum": spoilt(numbers(6))}, f"momentum {FINITE}"),
    ({"work": "much"}, "work is a str, not an array"),
    ({"momentum": numbers(6, 1)}, "momentum has shape (11, 6, 1); (11, 6) was expected"),
    ({"work": numbers(1)}, "work has shape (11, 1); (11,) was expected"),
    ({"work": spoilt(numbers(), 10)}, "work is not finite at t = 1 s, and the status is finished"),
    ({"undetermined": ["load:pivot.force"]}, "undetermined returned a list, not a tuple"),
    ({"wall_s": None}, "wall_s is None, not a number"),
    ({"wall_s": True}, "wall_s is a bool, not a number"),
    ({"wall_s": -1.0}, "wall_s is -1: a finite number from 0 is expected"),
    ({"wall_s": np.inf}, "wall_s is inf: a finite number from 0 is expected"),
    ({"evaluations": -1}, "evaluations is -1: a whole number from 0 is expected"),
    ({"steps": -1}, "steps is -1: a whole number from 0 is expected"),
    ({"operations": 1e6}, "operations is 1000000.0: a whole number from 0 is expected"),
    ({"evaluations": 1.0}, "evaluations is 1.0: a whole number from 0 is expected"),
    ({"evaluations": True}, "evaluations is True: a whole number from 0 is expected"),
    ({"evaluations": LARGEST_COUNT + 1}, "evaluations is 9223372036854775808: a whole number from 0 is expected"),
]


def test_numbers_that_nothing_determines_need_not_be_finite() -> None:
    """Only those that are named: neither the drive beside them nor another part of the same load."""
    open_drive = {"drives": GOOD.drives | {"pivot": spoilt(numbers(2))}, "undetermined": ("drive:pivot",)}
    assert checked_run(replace(GOOD, **open_drive), TIMES, SCENE).undetermined == ("drive:pivot",)
    both = GOOD.drives | {"pivot": spoilt(numbers(2)), "wheel": spoilt(numbers(1))}
    with pytest.raises(BrokenContract, match=r"drives\['wheel'\] is not finite"):
        checked_run(replace(GOOD, drives=both, undetermined=("drive:pivot",)), TIMES, SCENE)
    with pytest.raises(BrokenContract, match=r"drives\['pivot'\] is not finite"):
        checked_run(replace(GOOD, drives=open_drive["drives"], undetermined=("drive:wheel",)), TIMES, SCENE)
    torque = numbers(6)
    torque[3, :3] = np.nan
    half = {"loads": GOOD.loads | {"pivot": torque}}
    assert checked_run(replace(GOOD, **half, undetermined=("load:pivot.torque",)), TIMES, SCENE).status == "finished"
    with pytest.raises(BrokenContract, match=r"loads\['pivot'\] is not finite"):
        checked_run(replace(GOOD, **half, undetermined=("load:pivot.force",)), TIMES, SCENE)


def test_loads_of_a_tree_are_determined() -> None:
    """A claim that they are not would take those of all other engines out of the comparison."""
    tree, run = cast(Scene, SimpleNamespace(**OWN, constraints=())), replace(GOOD, loads={"pivot": numbers(6)})
    assert checked_run(run, TIMES, tree).status == "finished"
    with pytest.raises(BrokenContract, match="load:pivot.torque.*the scene has no closures or couplings"):
        checked_run(replace(run, undetermined=("load:pivot.torque",)), TIMES, tree)


@pytest.mark.parametrize("column", range(6))
def test_a_number_that_is_none_must_be_in_an_open_component(column: int) -> None:
    rows = numbers(6)
    rows[3, column] = np.nan
    (part, other), axis = ("torque", "force")[:: 1 if column < 3 else -1], "xyz"[column % 3]
    run = replace(GOOD, loads=GOOD.loads | {"pivot": rows}, undetermined=(f"load:pivot.{part}[{axis}]",))
    assert checked_run(run, TIMES, SCENE).undetermined == run.undetermined
    all_others = f"load:pivot.{part}[{', '.join('xyz'.replace(axis, ''))}]", f"load:pivot.{other}"
    with pytest.raises(BrokenContract, match=r"loads\['pivot'\] is not finite"):
        checked_run(replace(run, undetermined=all_others), TIMES, SCENE)


@pytest.mark.parametrize("name", ["drive:pivot[3]", "drive:pivot[0]", "load:pivot.force[w]", "load:pivot.force[1]"])
def test_a_component_that_the_run_does_not_have_is_refused(name: str) -> None:
    drives = GOOD.drives | {"pivot": numbers(2)}
    with pytest.raises(BrokenContract, match="it names channels of loads and drives that the run has"):
        checked_run(replace(GOOD, drives=drives, undetermined=(name,)), TIMES, SCENE)


@pytest.mark.parametrize(("change", "text"), BREACHES)
def test_each_breach_is_named_with_its_place(change: dict[str, Any], text: str) -> None:
    with pytest.raises(BrokenContract) as caught:
        checked_run(replace(GOOD, **change), TIMES, SCENE)
    said = str(caught.value)
    assert said.startswith(text)
    assert said.removeprefix(text) in ("", " was expected", " quaternions")


def test_what_is_no_run_and_what_is_long_is_named_in_short() -> None:
    with pytest.raises(BrokenContract, match=r"^simulate\(\) returned None, not a Trajectory$"):
        checked_run(None, TIMES, SCENE)
    none = cast(Scene, SimpleNamespace(**{kind: [] for kind in (*NAMES, "constraints")}))
    with pytest.raises(BrokenContract, match="^markers has 'tip', and the scene has none$"):
        checked_run(GOOD, TIMES, none)
    with pytest.raises(BrokenContract) as caught:
        checked_run(replace(GOOD, status="x" * 200), TIMES, SCENE)
    assert str(caught.value) == f"the status is '{'x' * 79}: it is one of finished, diverged, failed"


def test_edges_that_pass() -> None:
    for change in (
        {"wall_s": 0}, {"wall_s": np.float32(1.5)}, {"evaluations": 0}, {"evaluations": np.int64(3)},
        {"evaluations": LARGEST_COUNT}, {"message": ""}, {"markers": turned(1.0 + 0.9 * UNIT)},
        {"markers": turned(1.0 - 0.9 * UNIT)}, {"times": TIMES.astype(float) * (1.0 + 5 * np.finfo(float).eps)},
    ):  # fmt: skip
        run = checked_run(replace(GOOD, **cast(Any, change)), TIMES, SCENE)
        assert type(run.wall_s) is float and type(run.evaluations) is int
    with pytest.raises(BrokenContract, match=r"times\[\d+\]"):
        checked_run(replace(GOOD, times=TIMES * (1.0 + 20 * np.finfo(float).eps)), TIMES, SCENE)
    for factor in (1.0 + 1.1 * UNIT, 1.0 - 1.1 * UNIT):
        with pytest.raises(BrokenContract, match="unit quaternions"):
            checked_run(replace(GOOD, markers=turned(factor)), TIMES, SCENE)


@pytest.mark.parametrize("end", [0.25, 4.0])
def test_times_may_be_off_by_one_rounding_of_the_last_for_each_sample(end: float) -> None:
    times = np.linspace(0.0, end, T)
    for part, right in ((0.95, True), (1.05, False)):
        off = times.copy()
        off[1] += part * T * np.finfo(float).eps * end
        if right:
            assert len(checked_run(replace(GOOD, times=off), times, SCENE).times) == T
        else:
            with pytest.raises(BrokenContract, match=r"times\[1\] is"):
                checked_run(replace(GOOD, times=off), times, SCENE)
    start = Trajectory("finished", "", np.zeros(1), {})
    assert len(checked_run(start, np.zeros(1), SCENE).times) == 1


def test_a_quaternion_may_be_off_by_just_its_rounding() -> None:
    long = np.zeros((T, 4))
    long[:, 0] = 1.0 + UNIT
    run = checked_run(replace(GOOD, markers={"tip": replace(TIP, quaternion=long)}), TIMES, SCENE)
    assert np.array_equal(run.markers["tip"].quaternion, long)


def test_sound_answers_pass_as_they_are() -> None:
    assert checked_version("1.0") == "1.0"
    for kind in ("exact", "surrogate", "no"):
        assert checked_support(Support(cast(Any, kind), "why")) == Support(cast(Any, kind), "why")
    for ladder in (
        TOLERANCES,
        STEPS,
        STEPS[:3],
        (*TOLERANCES, *STEPS),
        (STEP, TOLERANCES[0], replace(STEP, value=0.1)),
    ):
        assert checked_ladder(ladder) == checked_ladder(list(ladder)) == ladder
    coarse = (replace(STEP, value=4), replace(STEP, value=2), replace(STEP, value=1))
    assert [type(effort.value) for effort in checked_ladder(coarse)] == [float] * 3
    two = (STEP, replace(STEP, method="euler"), replace(STEP, kind="tolerance"))
    assert checked_ladder(two) == two
    model = Pendulum(PENDULUM)
    assert checked_model(model) is model


@pytest.mark.parametrize(
    ("check", "answer", "text"),
    [
        (checked_version, None, "version() is None, not text"),
        (checked_version, 1.0, "version() is a float, not text"),
        (checked_version, " ", "version() is empty: name the version of the library"),
        (checked_support, True, "supports() returned a bool, not a Support"),
        (
            checked_support,
            Support(cast(Any, "yes")),
            "the kind of supports() is 'yes': it is one of exact, surrogate, no",
        ),
        (checked_support, Support("no", cast(Any, 1)), "the reason of supports() is a int, not text"),
        (checked_model, 1, "compile() returned a int, which is no model"),
        (checked_ladder, None, "efforts() is None, not a tuple of efforts"),
        (checked_ladder, {1: 2}, "efforts() is a dict, not a tuple of efforts"),
        (checked_ladder, (STEP, "x"), "efforts()[1] returned a str, not a Effort"),
        (checked_ladder, STEPS[:2], "efforts() has 2 efforts: an uncertainty needs at least 3"),
        (checked_ladder, (STEP, *STEPS[:2], STEPS[1]), "efforts() has the same effort twice"),
        (
            checked_ladder,
            (STEP, replace(STEP, value=0.1), replace(STEP, value=0.2)),
            "efforts() are not from coarse to fine: rk4 h=0.2 comes after 0.1",
        ),
        (checked_ladder, (replace(STEP, value=0.0),), "efforts()[0].value is 0: a tolerance or a step (s) is positive"),
        (checked_ladder, (replace(STEP, value=-1.0),), "efforts()[0].value is -1: a finite number from 0 is expected"),
        (
            checked_ladder,
            (replace(STEP, value=np.nan),),
            "efforts()[0].value is nan: a finite number from 0 is expected",
        ),
        (checked_ladder, (replace(STEP, value=cast(Any, "1")),), "efforts()[0].value is a str, not a number"),
        (checked_ladder, (replace(STEP, method=cast(Any, None)),), "efforts()[0].method is None, not text"),
        (
            checked_ladder,
            (replace(STEP, kind=cast(Any, "speed")),),
            "efforts()[0].kind is 'speed': it is one of tolerance, step",
        ),
    ],
)
def test_each_wrong_answer_is_named(check: Any, answer: Any, text: str) -> None:
    with pytest.raises(BrokenContract) as caught:
        check(answer)
    assert str(caught.value) == text


def test_text_of_just_the_length_that_is_kept_is_whole() -> None:
    assert clean("x" * LONGEST_TEXT) == "x" * LONGEST_TEXT
    assert clean("x" * (LONGEST_TEXT + 1)) == "x" * LONGEST_TEXT + " ... (1 characters more)"
