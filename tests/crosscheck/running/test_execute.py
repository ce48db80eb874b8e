"""Doing a job in this process: what becomes of each answer and each fault of an engine, field by field."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest

from crosscheck.engines.answers import LONGEST_TEXT, BrokenContract, describe
from crosscheck.engines.contract import Effort, EngineMissing, Run, Support, Trajectory
from crosscheck.engines.registry import find_engine
from crosscheck.judging.uncertainty import RUNGS
from crosscheck.library.find import load_case
from crosscheck.records.kinds import Confirmed, RunRecord
from crosscheck.records.packing import unpack
from crosscheck.running import execute as module
from crosscheck.running import rung as of_rungs
from crosscheck.running.execute import execute
from crosscheck.running.job import Done, Job
from flexmb.run.channels import channels_of
from flexmb.scene.schema import Scene
from tests.crosscheck.fake_engines import Fake, Pendulum
from tests.crosscheck.sessions import CASE

LOADED = load_case(CASE)
SCENE = LOADED.scene(LOADED.run.variants[0])
TIMES = np.linspace(0.0, 0.2, 5)
LADDER = tuple(Effort(kind="step", value=0.05 / 2**n, method="rk4") for n in range(5))
LABELS = [effort.label for effort in LADDER]
TIP = "marker:tip.position"
MADE: dict[str, Fake] = {}
Play = Callable[[Trajectory, int], Trajectory]


def engines() -> dict[str, Fake]:
    """The provider of these tests: the engine of the test that runs, and one that nobody asks for."""
    return MADE


@dataclass
class Actor(Fake):
    """The pendulum, each of whose runs is changed by `play`, which is told how many there were before.

    `heard` is the order of the calls; `says` replaces an answer other than a run, or is an error to raise in its place.
    """

    name: str = "actor"
    ladder: tuple[Effort, ...] = LADDER
    play: Play = lambda run, count: run
    says: dict[str, Any] = field(default_factory=dict)
    heard: list[str] = field(default_factory=list)

    def answer(self, call: str, otherwise: Any) -> Any:
        self.heard.append(call)
        found = self.says.get(call, otherwise)
        if isinstance(found, BaseException):
            raise found
        return found

    def version(self) -> str:
        return self.answer("version", "1.0")

    def supports(self, scene: Any) -> Support:
        assert scene is SCENE
        return self.answer("supports", Support("surrogate", "rigid for flexible"))

    def efforts(self, scene: Any) -> tuple[Effort, ...]:
        assert scene is SCENE
        return self.answer("efforts", self.ladder)

    def compile(self, scene: Any) -> Any:
        return self.answer("compile", Played(scene, actor=self))


@dataclass
class Played(Pendulum):
    actor: Any = None
    count: int = 0

    def warm_up(self) -> None:
        self.actor.answer("warm_up", None)

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        self.actor.answer(f"simulate {effort.label}", None)
        self.count += 1
        return self.actor.play(slow(super().simulate(run, effort)), self.count - 1)


def slow(run: Trajectory, wall_s: float = 1.0) -> Trajectory:
    """A run that took long enough not to be repeated."""
    return replace(run, wall_s=wall_s)


def cut(run: Trajectory, status: Any = "diverged", count: int = 2, message: str = "at 0.05 s") -> Trajectory:
    """The run as one that ended after `count` samples."""
    tip = run.markers["tip"]
    path = replace(tip, position=tip.position[:count], quaternion=tip.quaternion[:count], velocity=tip.velocity[:count])
    return Trajectory(status, message, run.times[:count], {"tip": path}, wall_s=0.001, evaluations=7)


def on_a_clock(monkeypatch: pytest.MonkeyPatch, seconds: float) -> None:
    """Every look at the worker's clock is so many seconds after the one before, and at that of its processor half."""
    clock, processor = itertools.count(10.0, seconds), itertools.count(0.0, seconds / 2.0)
    clocks = SimpleNamespace(perf_counter=lambda: next(clock), process_time=lambda: next(processor))
    for timed in (module, of_rungs):
        monkeypatch.setattr(timed, "time", clocks)


@pytest.fixture(autouse=True)
def quick_keys(monkeypatch: pytest.MonkeyPatch) -> list[frozenset[str]]:
    """The key of the sources has tests of its own (test_made_by): here it says what it was asked for."""
    asked: list[frozenset[str]] = []

    def made_by(modules: Any) -> str:
        asked.append(frozenset(modules))
        return ",".join(sorted(modules))

    monkeypatch.setattr(module, "made_by", made_by)
    MADE.clear()
    return asked


def job(engine: str = "actor", **changes: Any) -> Job:
    given = Job(
        case="made/made", variant="rigid", role="main", engine=engine, scene=SCENE, scene_id="id", times=TIMES,
        provider="tests.crosscheck.running.test_execute:engines", maker="",
    )  # fmt: skip
    return replace(given, **changes)


def emitted(actor: Fake | None = None, **changes: Any) -> list[Any]:
    if actor is not None:
        MADE.update({actor.name: actor, "other": Fake("other")})
    found: list[Any] = []
    execute(job(**changes), found.append)
    return found


def records(actor: Fake | None = None, **changes: Any) -> list[RunRecord]:
    return [each for each in emitted(actor, **changes) if isinstance(each, RunRecord)]


def the(status: str, message: str, **fields: Any) -> RunRecord:
    """A record without a run."""
    given: dict[str, Any] = {
        "case": "made/made", "variant": "rigid", "role": "main", "engine": "actor", "version": "", "scene": "id"
    }  # fmt: skip
    return RunRecord(**(given | fields), status=status, message=message)


def test_a_scene_that_cannot_be_made_fails_without_its_engine() -> None:
    actor = Actor()
    found = emitted(actor, scene=None, scene_id="", error="no body", role="refined")
    assert found == [the("failed", "the scene cannot be made: no body", scene="", role="refined")]
    assert actor.heard == []


def test_an_engine_that_is_none_did_not_run_and_the_others_are_named() -> None:
    found = emitted(Actor(), engine="acter")
    text = 'there is no engine "acter": did you mean "actor"?'
    assert found == [the("did not run", text, engine="acter")]
    MADE["actor"] = actor = Actor()
    assert find_engine("tests.crosscheck.running.test_execute:engines", "actor") is actor


def test_a_missing_library_did_not_run() -> None:
    missing = EngineMissing("install \ud800" + "x" * LONGEST_TEXT)
    (found,) = emitted(Actor(says={"version": missing}))
    assert (found.status, found.version) == ("did not run", "")
    assert found.message.startswith("install \\ud800xxx") and found.message.endswith("(9 characters more)")


@pytest.mark.parametrize("call", ["version", "supports", "efforts", "compile", "warm_up"])
@pytest.mark.parametrize("error", [ValueError("no"), SystemExit("no"), MemoryError("no"), RecursionError("no")])
def test_a_fault_before_any_run_is_that_engines_failure(call: str, error: BaseException) -> None:
    found = records(Actor(says={call: error}))
    assert [each.status for each in found] == ["failed"]
    assert found[0].message.startswith(f"{type(error).__name__}: no (answer, test_execute.py line ")
    assert (found[0].scene, found[0].effort, found[0].version) == ("id", "", "")


@pytest.mark.parametrize("call", ["version", f"simulate {LABELS[1]}"])
def test_the_user_ends_it(call: str) -> None:
    with pytest.raises(KeyboardInterrupt):
        emitted(Actor(says={call: KeyboardInterrupt()}))


@pytest.mark.parametrize(
    ("call", "answer", "text"),
    [
        ("version", "", "version() is empty: name the version of the library"),
        ("supports", None, "supports() returned None, not a Support"),
        ("efforts", LADDER[:2], "efforts() has 2 efforts: an uncertainty needs at least 3"),
        ("compile", None, "compile() returned None, which is no model"),
    ],
)
def test_an_answer_against_the_contract_is_a_failure(call: str, answer: Any, text: str) -> None:
    (found,) = records(Actor(says={call: answer}))
    assert (found.status, found.message) == ("failed", f"broke the contract: {text}")


def test_errors_are_described_with_their_place_and_without_their_faults() -> None:
    class Mute(Exception):
        def __str__(self) -> str:
            raise ValueError

    assert describe(ValueError("why")) == "ValueError: why"
    assert describe(Mute()) == "Mute: its message cannot be read"
    assert describe(BrokenContract("so")) == "broke the contract: so"
    assert describe(BrokenContract("x" * LONGEST_TEXT)).endswith("(20 characters more)")
    assert describe(ValueError("x" * LONGEST_TEXT)).endswith("(12 characters more)")


def test_the_place_of_an_error_is_where_it_was_raised() -> None:
    names: dict[str, Any] = {}
    exec(compile("def fall():\n\n    raise ValueError('why')\n", "/far/odd.py", "exec"), names)
    exec(compile("def stumble():\n    fall()\n", "/far/even.py", "exec"), names)
    with pytest.raises(ValueError) as caught:
        names["stumble"]()
    assert describe(caught.value) == "ValueError: why (fall, odd.py line 3)"


def test_a_refusal_is_recorded_and_nothing_is_compiled() -> None:
    actor = Actor(says={"supports": Support("no", "no beams")})
    assert emitted(actor) == [the("refused", "no beams", version="1.0", support="no beams")]
    assert actor.heard == ["version", "supports"]


def test_what_an_engine_leaves_undetermined_is_recorded_and_its_numbers_are_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Scene, "constraints", (SimpleNamespace(name="loop"),))
    open_load = "load:pivot.torque"
    (found,) = records(Actor(play=lambda run, count: replace(run, undetermined=(open_load,))), finest_only=True)
    assert found.undetermined == (open_load,) and open_load not in found.channels
    assert "load:pivot.force" in found.channels
    open_part = "load:pivot.force[x, z]"
    (found,) = records(Actor(play=lambda run, count: replace(run, undetermined=(open_part,))), finest_only=True)
    assert found.undetermined == (open_part,)
    rows = unpack(found.channels["load:pivot.force"])
    assert np.array_equal(np.isnan(rows), np.tile([True, False, True], (len(rows), 1)))


def test_an_engine_is_asked_about_the_start_and_the_duration_of_the_job() -> None:
    actor = Actor()
    (found,) = emitted(actor, times=TIMES + 3.0)
    assert (found.status, found.message) == ("refused", "the adapter of engine actor begins all runs at t = 0")
    asked: list[float] = []
    actor.takes = ("t_start",)
    actor.efforts_for = lambda scene, duration_s: asked.append(duration_s) or LADDER[:1]
    emitted(actor, times=TIMES + 3.0)
    assert asked == [pytest.approx(0.2)]


def counting(run: Trajectory, count: int) -> Trajectory:
    return replace(
        run, wall_s=0.5 + count, evaluations=40 + count, steps=20 + count, operations=count, message="fine"
    )


def test_a_run_is_recorded_in_every_field(monkeypatch: pytest.MonkeyPatch) -> None:
    on_a_clock(monkeypatch, 2.5)
    actor = Actor(play=counting)
    ladder = LADDER[:3]
    found = emitted(actor, efforts=ladder, role="control:mass")
    assert found[0] == "compiling"
    assert found[1::2] == LABELS[:3]
    runs = [f"simulate {each}" for each in (*[LABELS[0]] * 3, *LABELS[1:3])]  # before and after it, its beginning
    assert actor.heard == ["version", "supports", "compile", "warm_up", *runs]
    key = found[2].made_by
    for rung, count, record, effort in zip(range(3), (1, 3, 4), found[2::2], ladder, strict=True):
        assert msgspec.structs.replace(record, times=None, channels={}) == the(
            "finished", "fine", role="control:mass", version="1.0", support="rigid for flexible", made_by=key,
            effort=effort.label, effort_kind="step", effort_method="rk4", effort_value=effort.value, rung=rung,
            rungs=3, compile_s=2.5, wall_s=0.5 + count, cpu_s=1.25, evaluations=40 + count, steps=20 + count,
            operations=count,
        )  # fmt: skip
        wanted = channels_of(Pendulum(SCENE).simulate(Run(TIMES), effort))
        assert record.channels.keys() == wanted.keys()
        assert np.array_equal(unpack(record.times), TIMES)
        for name, values in wanted.items():
            assert np.array_equal(unpack(record.channels[name]), values)


def test_only_the_finest_effort_where_no_more_is_asked() -> None:
    (found,) = records(Actor(), finest_only=True)
    assert (found.effort, found.rung, found.rungs) == (LABELS[-1], 4, 5)
    assert set(found.channels) > {TIP}


def test_coarse_efforts_store_what_is_kept_and_those_that_uncertainties_need_everything() -> None:
    found = records(Actor(), kept=(TIP, "no such channel"))
    full = set(found[-1].channels)
    assert len(full) > 5
    assert [set(each.channels) for each in found] == [{TIP}, *4 * [full]]
    assert [set(record.channels) for record in records(Actor())][:2] == [set(), full]
    assert module.FULLY_STORED == RUNGS
    assert all(np.array_equal(unpack(each.times), TIMES) for each in found)


def key_of(actor: Actor, **changes: Any) -> str:
    return records(actor, **changes)[0].made_by


def test_the_key_holds_all_that_the_result_depends_on(
    quick_keys: list[frozenset[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The modules of the engine and of its maker, its version, and what is stored where not all is."""
    first = key_of(Actor())
    assert quick_keys == [frozenset({"tests.crosscheck.running.test_execute"})]
    assert len(first) == 16 and int(first, 16) >= 0
    assert key_of(Actor()) == first
    assert key_of(Actor(), maker="somewhere") != first
    assert quick_keys[-1] == frozenset({"tests.crosscheck.running.test_execute", "somewhere"})
    monkeypatch.setattr(module, "made_by", lambda modules: "tests.crosscheck.running.test_execute")
    assert key_of(Actor()) == first
    assert key_of(Actor(says={"version": "1.1"})) != first
    assert key_of(Actor(), kept=(TIP,)) != first
    assert key_of(Actor(), kept=(TIP,), efforts=LADDER[:4]) == key_of(Actor(), efforts=LADDER[:4]) == first


def test_what_is_done_is_confirmed_and_not_run_again() -> None:
    key = key_of(Actor())
    confirmed = Confirmed(case="made/made", variant="rigid", role="main", engine="actor", scene="id", made_by=key)
    done = frozenset(Done(label, key, rung, 5) for rung, label in enumerate(LABELS))
    actor = Actor()
    assert emitted(actor, done=done) == [confirmed]
    assert actor.heard == ["version", "supports", "efforts"]
    found = emitted(Actor(), done=done - {Done(LABELS[1], key, 1, 5)})
    assert found[:3] == [confirmed, "compiling", LABELS[1]]
    assert [each.effort for each in found[3:]] == [LABELS[1]]
    assert emitted(Actor(), done=done, finest_only=True) == [confirmed]


@pytest.mark.parametrize("change", [{"made_by": "another"}, {"rung": 9}, {"rungs": 4}, {"effort": "another"}])
def test_what_was_done_otherwise_is_run_again(change: dict[str, Any]) -> None:
    key = key_of(Actor())
    done = frozenset(Done(label, key, rung, 5)._replace(**change) for rung, label in enumerate(LABELS))
    found = emitted(Actor(), done=done)
    assert found[0] == "compiling" and found[1::2] == LABELS


def test_a_diverged_run_keeps_its_good_part_and_is_not_repeated() -> None:
    actor = Actor(play=lambda run, count: cut(run))
    found = records(actor)[-1]
    assert (found.status, found.message, found.wall_s, found.evaluations) == ("diverged", "at 0.05 s", 0.001, 7)
    assert np.array_equal(unpack(found.times), TIMES[:2])
    assert len(unpack(found.channels[TIP])) == 2
    assert len(actor.heard) == 5 + 1 + len(LADDER)  # the beginning of the coarsest was run before it


def test_a_run_that_ended_at_once_has_no_times() -> None:
    found = records(Actor(play=lambda run, count: cut(run, "failed", 0, "singular")))[-1]
    assert (found.status, found.message, found.times, found.channels) == ("failed", "singular", None, {})
    assert (found.wall_s, found.evaluations) == (0.001, 7)


def test_a_short_run_is_repeated_and_its_shortest_time_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    times = (0.03, 0.01, 0.02)
    actor = Actor(play=lambda run, count: slow(run, times[count % 3]))
    assert [record.wall_s for record in records(actor)] == [0.01] * 5
    assert len(actor.heard) == 5 + 1 + 3 * 5
    less_short = Actor(play=lambda run, count: slow(run, 0.05 + 0.01 * (count % 2)))
    on_a_clock(monkeypatch, 0.06)
    assert [record.wall_s for record in records(less_short)] == [0.05] * 5
    assert len(less_short.heard) == 5 + 1 + 2 * 5


def test_of_the_coarsest_of_long_runs_the_beginning_is_run_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    on_a_clock(monkeypatch, 0.125)
    lengths: list[int] = []

    def play(run: Trajectory, count: int) -> Trajectory:
        lengths.append(len(run.times))
        return slow(run, 0.1)

    actor = Actor(play=play)
    assert [record.wall_s for record in records(actor, times=np.linspace(0.0, 0.2, 31))] == [0.1] * 5
    assert lengths == [4, 31, 4, 31, 31, 31, 31]


@pytest.mark.parametrize("noise", [lambda count: count, lambda count: count == 0, lambda count: count > 0])
def test_a_long_run_that_is_another_each_time_is_a_failure(monkeypatch: pytest.MonkeyPatch, noise: Callable) -> None:
    """Also where only the first call of all differs, as of an engine that keeps what it had found."""
    on_a_clock(monkeypatch, 0.125)
    noisy = Actor(play=lambda run, count: replace(run, momentum=run.momentum * (1 + 1e-9 * noise(count))))
    found = records(noisy)
    assert [each.status for each in found] == ["failed", *["finished"] * 4]
    assert "not reproducible: momentum.angular differs when the same effort is run again" in found[0].message


def test_a_run_is_as_short_as_the_worker_says_whatever_the_engine_claims() -> None:
    """Noise of 1e-9 at each call, and a second claimed for a solve of some milliseconds."""
    noisy = Actor(play=lambda run, count: replace(run, momentum=run.momentum * (1 + 1e-9 * count), wall_s=1.0))
    found = records(noisy)
    assert [each.status for each in found] == ["failed"] * 5
    assert "not reproducible: momentum.angular differs when the same effort is run again" in found[0].message


@pytest.mark.parametrize(
    ("other", "text"),
    [
        (lambda run: cut(run), "the same effort finished once and diverged the next time"),
        (lambda run: cut(run, "failed"), "the same effort finished once and failed the next time"),
        (lambda run: replace(run, energy={}), "energy.kinetic differs when the same effort is run again"),
        (
            lambda run: replace(run, momentum=run.momentum * (1 + 1e-15)),
            "momentum.angular differs when the same effort is run again",
        ),
    ],
)
@pytest.mark.parametrize("at", [2, 3])
def test_a_run_that_is_another_each_time_is_a_failure(other: Callable, text: str, at: int) -> None:
    def play(run: Trajectory, count: int) -> Trajectory:
        run = slow(run, 0.01)
        return other(run) if count == at else run

    found = records(Actor(play=play))
    assert [each.status for each in found] == ["failed", *["finished"] * 4]
    assert found[0].message == f"broke the contract: not reproducible: {text}"
    assert (found[0].effort, found[0].rung, found[0].times, found[0].channels) == (LABELS[0], 0, None, {})


def test_one_effort_that_raises_leaves_the_others() -> None:
    found = records(Actor(says={f"simulate {LABELS[2]}": SystemExit(3)}))
    assert [each.status for each in found] == ["finished", "finished", "failed", "finished", "finished"]
    assert found[2].message.startswith("SystemExit: 3 (answer, test_execute.py line ")
    assert (found[2].effort, found[2].rung, found[2].rungs, found[2].version) == (LABELS[2], 2, 5, "1.0")


def test_a_run_against_the_contract_is_a_failure_and_times_are_the_engines_own() -> None:
    def shifted(run: Trajectory, count: int) -> Trajectory:
        run.times[-1] = 7.0  # its own array: what was asked for is as it was
        return run

    found = records(Actor(play=shifted))
    assert [each.status for each in found] == ["failed"] * 5
    assert "times[1] is 7 s where 0.05" in found[0].message  # of its beginning
    assert all("times[4] is 7 s where 0.2" in each.message for each in found[1:])
    assert TIMES[-1] == 0.2
