"""The clauses of the contract can fail: bad engines break those of form, planted faults those of mechanics."""

import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from crosscheck.conformance import form
from crosscheck.conformance.catalogue import CLAUSES, SHOWN
from crosscheck.conformance.clause import ClauseBroken, equal, told_apart, within
from crosscheck.conformance.form import FORM
from crosscheck.conformance.samples import SAMPLES
from crosscheck.conformance.trial import ClauseOutcome, ContractVerdict, to_offer, try_clause, verdict_on
from crosscheck.engines.contract import Engine, Model, Run, Snapshot, Support, Trajectory
from crosscheck.engines.registry import engine
from flexmb.scene.schema import Scene
from tests.crosscheck.engines.bad_engines import ANSWERS, LADDER, Faulty, answers, does
from tests.crosscheck.fake_engines import Absent, Fake, Pendulum, Refuser


def outcomes_of(tried: Engine, names: Any = tuple(CLAUSES)) -> dict[str, ClauseOutcome]:
    return {name: try_clause(tried, CLAUSES[name]) for name in names}


def broken(outcomes: dict[str, ClauseOutcome]) -> set[str]:
    return {name for name, outcome in outcomes.items() if outcome.status == "broken"}


FORMAL = [clause.name for clause in FORM.clauses]


def test_a_sound_engine_keeps_every_clause_of_form() -> None:
    assert {outcome.status for outcome in outcomes_of(Fake("fine"), FORMAL).values()} == {"holds"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if i % 3 else ()) for i, name in enumerate(ANSWERS)]
)
def test_every_bad_answer_breaks_a_clause_of_form(name: str) -> None:
    """With the reason that a run of a case would give, or with what the clause says of it; by default one in three."""
    found = outcomes_of(ANSWERS[name].make(), FORMAL)
    assert broken(found), found
    assert all(found[clause].message for clause in broken(found))


def test_an_engine_without_its_library_keeps_nothing() -> None:
    verdict = verdict_on(list(outcomes_of(Absent("absent"), FORMAL).values()))
    assert (verdict.kept, "install the extra `absent`" in verdict.text) == (False, True), verdict


def test_an_engine_that_refuses_everything_has_shown_nothing() -> None:
    outcomes = list(outcomes_of(Refuser("refuser")).values())
    verdict = verdict_on(outcomes)
    assert (verdict.kept, verdict.whole, "too little was shown" in verdict.text) == (False, False, True), verdict
    assert "Offer first: represent revolute hinges, or any other simple scene" in verdict.text
    lines = to_offer(outcomes)
    assert "represent prismatic hinges, motors" in lines
    assert 'represent free hinges, connectors: bushing and name "connectors" in `takes`' in lines
    assert sum(map(len, lines.values())) == sum(outcome.status == "not offered" for outcome in outcomes)


def test_what_shows_too_little_is_not_kept_however_much_holds() -> None:
    """Every clause but those of form, and every clause but the runs that are known in closed form."""
    holding = [ClauseOutcome(name, "", "holds") for name in CLAUSES]
    count = len(CLAUSES)
    assert verdict_on(holding) == ContractVerdict(True, True, f"{count} of {count} clauses hold, 0 broken")
    for lacking in (["a-solve-takes-time"], list(SHOWN)):
        idle = [replace(each, status="not offered", offer="move") for each in holding if each.clause in lacking]
        verdict = verdict_on([*idle, *(each for each in holding if each.clause not in lacking)])
        assert (verdict.kept, verdict.whole) == (False, False) and verdict.text.endswith("Offer first: move"), verdict
    partly = [replace(each, status="not offered") if each.clause == SHOWN[0] else each for each in holding]
    assert (verdict_on(partly).kept, verdict_on(partly).whole) == (True, False)


def test_a_refusal_without_a_reason_is_noticed() -> None:
    class Silent(Fake):
        def supports(self, scene: Scene) -> Support:
            return Support("no")

    assert "a-refusal-has-a-reason" in broken(outcomes_of(Silent("silent"), FORMAL))


Change = Callable[[Any], Any]


class Falsified:
    """The native engine, with its snapshots and its runs changed."""

    name = "falsified"

    def __init__(self, snapshot: Change = lambda found: found, run: Change = lambda found: found) -> None:
        self._native, self._snapshot, self._run = engine("native"), snapshot, run
        self.version, self.supports, self.efforts = self._native.version, self._native.supports, self._native.efforts
        self.takes = self._native.takes

    def compile(self, scene: Scene) -> Model:
        return FalsifiedModel(self._native.compile(scene), self._snapshot, self._run)


class FalsifiedModel:
    def __init__(self, model: Model, snapshot: Change, run: Change) -> None:
        self._model, self._snapshot, self._run, self.warm_up = model, snapshot, run, model.warm_up

    def evaluate(self) -> Snapshot:
        return self._snapshot(self._model.evaluate())

    def simulate(self, run: Run, effort: Any) -> Trajectory:
        return self._run(self._model.simulate(run, effort))


def markers(**change: Change) -> Change:
    """Parts of every marker changed."""

    def changed(found: Snapshot) -> Snapshot:
        made = {
            name: replace(marker, **{part: function(getattr(marker, part)) for part, function in change.items()})
            for name, marker in found.markers.items()
        }
        return replace(found, markers=made)

    return changed


def each(name: str, change: Change) -> Change:
    """Every item of an output changed."""
    return lambda found: replace(found, **{name: {key: change(value) for key, value in getattr(found, name).items()}})


def swapped(values: np.ndarray) -> np.ndarray:
    return np.concatenate([values[3:], values[:3]])


def at_few_samples(output: str) -> Change:
    """The sign of an output changed at three samples of a run, those of one quadrant, say."""
    few = np.ones(41)
    few[[12, 17, 18]] = -1.0
    sign = lambda values: values * few[: len(values)].reshape(-1, *[1] * (values.ndim - 1))  # noqa: E731
    return lambda run: replace(run, **{output: made_of(getattr(run, output), sign)})


def made_of(found: Any, change: Change) -> Any:
    return {name: change(values) for name, values in found.items()} if isinstance(found, dict) else change(found)


def slower(run: Trajectory) -> Trajectory:
    """Every position as if gravity were a thousandth weaker."""
    paths = {name: replace(path, position=path.position * 0.999) for name, path in run.markers.items()}
    return replace(run, markers=paths)


FAULTS = {
    "a load whose sign is wrong at few samples": (
        lambda found: found, at_few_samples("loads"), "loads-of-a-run-hold-at-every-sample"
    ),
    "a drive whose sign is wrong at few samples": (
        lambda found: found, at_few_samples("drives"), "drive-loads-of-a-run-hold-at-every-sample"
    ),
    "a momentum whose sign is wrong at few samples": (
        lambda found: found, at_few_samples("momentum"), "momentum-and-energy-of-a-run-hold-at-every-sample"
    ),
    "an energy whose sign is wrong at few samples": (
        lambda found: found, at_few_samples("energy"), "momentum-and-energy-of-a-run-hold-at-every-sample"
    ),
    "a line whose sign is wrong at few samples": (
        lambda found: found, at_few_samples("connectors"), "connector-loads-of-a-run-hold-at-every-sample"
    ),
    "a path that is off by a thousandth": (lambda found: found, slower, "a-thrown-body-flies"),
    "loads on the inboard body": (each("loads", np.negative), {}, "a-hanging-mass-is-held-up"),
    "loads with the force first": (each("loads", swapped), {}, "a-hanging-mass-is-held-up"),
    "loads about the mass centre": (
        each("loads", lambda load: load - np.concatenate([np.cross([1.0, 0, 0], load[3:]), np.zeros(3)])), {},
        "loads-are-about-the-outboard-hinge-point",
    ),
    "quaternions that map World to body": (
        markers(quaternion=lambda q: q * [1, -1, -1, -1]), {}, "quaternions-are-scalar-first"
    ),
    "quaternions with the scalar last": (
        markers(quaternion=lambda q: np.roll(q, -1)), {}, "quaternions-are-scalar-first"
    ),
    "velocities with the linear part first": (markers(velocity=swapped), {}, "free-velocities-are-in-outboard-axes"),
    "proper accelerations": (
        markers(acceleration=lambda a: a + np.array([0, 0, 0, 0, 0, 9.81])), {}, "gravity-accelerates-along-its-vector"
    ),
    "momentum about another point": (
        lambda found: replace(found, momentum=found.momentum + [0.1, 0, 0, 0, 0, 0]), {},
        "momentum-is-about-the-world-origin",
    ),
    "drive loads with the other sign": (each("drives", np.negative), {}, "prescribed-hinge-reports-its-drive-load"),
    "wheel loads on the body": (each("wheel_loads", np.negative), {}, "spinning-wheel-needs-a-gyroscopic-torque"),
    "work done by the arm": (lambda found: found, lambda run: replace(run, work=-run.work), "work-balances-energy"),
    "energy without its springs": (
        lambda found: found, lambda run: replace(run, energy=run.energy | {"spring": 0.0 * run.energy["spring"]}),
        "energy-is-kept",
    ),
}  # fmt: skip


def test_every_clause_on_samples_has_its_fault() -> None:
    assert {clause.name for clause in SAMPLES.clauses} <= {clause for _, _, clause in FAULTS.values()}


def claims(wall_s: float) -> Callable[..., Any]:
    return answers(lambda run: replace(run, wall_s=wall_s))


def the_finest(model: Pendulum, run: Run, effort: Any) -> Trajectory:
    """Whatever effort is asked for, it is one."""
    return model.simulate(run, LADDER[-1])


def wait_for_ever() -> None:
    threading.Thread(target=threading.Event().wait, daemon=True, name="forgotten").start()


KEPT: list[Any] = []
FORMAL_FAULTS: dict[str, tuple[Any, str, str]] = {
    "a solve of no time": (claims(0.0), "a-solve-takes-time", "time the solve by a clock"),
    "a solve of a picosecond": (claims(1e-12), "a-solve-takes-time", "time the solve by a clock"),
    "a solve longer than its call": (claims(60.0), "a-solve-takes-time", "are no part of it"),
    "efforts that are one": (the_finest, "efforts-make-a-difference", "two efforts give the same numbers"),
    "a thread that stays": (does(wait_for_ever), "a-run-leaves-nothing-behind", "threads of Python (forgotten, "),
    "a file that stays open": (
        does(lambda: KEPT.append(open(__file__, encoding="utf-8"))),  # noqa: SIM115
        "a-run-leaves-nothing-behind", "4 open files more",
    ),
    "a process that goes on": (
        does(lambda: KEPT.append(subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"]))),
        "a-run-leaves-nothing-behind", "4 processes more",
    ),
    "a momentum whose sign depends on how many samples there are": (
        lambda model, run, effort: at_many_samples(model.simulate(run, effort)),
        "sample-times-do-not-change-the-motion", "with fewer sample times momentum.angular is",
    ),
}  # fmt: skip


def at_many_samples(run: Trajectory) -> Trajectory:
    return replace(run, momentum=-run.momentum) if len(run.times) < 5 else run


@pytest.fixture
def nothing_kept(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(form, "CLEANUP_S", 0.1)  # what stays behind here stays for ever
    yield
    while KEPT:
        found = KEPT.pop()
        if isinstance(found, subprocess.Popen):
            found.kill()
            found.wait()
        else:
            found.close()


@pytest.mark.usefixtures("nothing_kept")
@pytest.mark.parametrize("fault", FORMAL_FAULTS)
def test_a_fault_of_an_engine_that_offers_little_breaks_its_clause(fault: str) -> None:
    """Plug-ins that ended with "0 broken": each is a sound pendulum but for this."""
    wrong, clause, words = FORMAL_FAULTS[fault]
    found = try_clause(Faulty("faulty", wrong, {}), CLAUSES[clause])
    assert found.status == "broken" and words in found.message, found


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_efforts_for_one_of_the_scenes_are_noticed(count: int) -> None:
    few = Faulty("few", None, {"efforts": lambda scene: LADDER if scene.name == "pendulum" else LADDER[:count]})
    found = try_clause(few, CLAUSES["efforts-are-a-ladder"])
    assert found.status == "broken" and f"efforts() has {count} efforts" in found.message, found


def test_an_engine_that_knows_no_pendulum_is_held_to_the_form_on_what_it_knows() -> None:
    class Flyer(Falsified):
        def __init__(self) -> None:
            super().__init__()
            self.supports = self.only_flights

        def only_flights(self, scene: Scene) -> Support:
            return Support("no", "it flies") if scene.hinges[0].name == "pivot" else Support("exact")

    assert {outcome.status for outcome in outcomes_of(Flyer(), FORMAL).values()} == {"holds"}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_breaks_its_clause(fault: str) -> None:
    snapshot, run, clause = FAULTS[fault]
    wrong = Falsified(snapshot, run or (lambda found: found))
    assert try_clause(wrong, CLAUSES[clause]).status == "broken"
    assert try_clause(Falsified(), CLAUSES[clause]).status == "holds"


def test_what_is_broken_says_which_numbers_came() -> None:
    wrong = Falsified(each("loads", np.negative))
    message = try_clause(wrong, CLAUSES["a-hanging-mass-is-held-up"]).message
    assert "must be [0 0 0 0 0 19.6] and is" in message, message


@pytest.mark.parametrize(
    "first, second, told",
    [
        (1.0, 2.0, ("1", "2")),
        (0.3331, 0.3334, ("0.3331", "0.3334")),
        (1 / 3, np.nextafter(1 / 3, 1.0), ("0.3333333333333333", "0.3333333333333334")),
        (float("nan"), 1.0, ("nan", "1")),
        (float("nan"), float("nan"), ("nan", "nan")),
        (float("inf"), 1e300, ("inf", "1e+300")),
        ([1.0, 0.5], [1.0, 0.50001], ("[1 0.5]", "[1 0.50001]")),
        ([1.0], [1.0, 2.0], ("[1]", "[1 2]")),
        ([], [], ("[]", "[]")),
    ],
)
def test_unequal_numbers_are_told_apart(first: object, second: object, told: tuple[str, str]) -> None:
    assert told_apart(first, second) == told


def test_what_may_differ_need_not_be_told_apart() -> None:
    assert told_apart([1.0, 2.0], [1.0 + 1e-12, 3.0], 1e-9) == ("[1 2]", "[1 3]")


def test_messages_show_what_they_compare() -> None:
    with pytest.raises(ClauseBroken, match=r"must be 0\.333333 and is 0\.333334"):
        equal("it", 0.333334, 0.333333)
    with pytest.raises(ClauseBroken, match=r"off by 0\.002793, where 0\.002791 can"):
        within("it", 0.002793, 0.002791)
    with pytest.raises(ClauseBroken, match="off by nan"):
        within("it", float("nan"), 1.0)


@pytest.mark.parametrize("name", ["inner-hinges-accelerate", "gravity-turns-a-level-arm-down"])
def test_an_engine_that_knows_no_accelerations_does_not_offer_them(name: str) -> None:
    silent = Falsified(markers(acceleration=lambda _: None))
    found = try_clause(silent, CLAUSES[name])
    assert (found.status, found.offer) == ("not offered", "give accelerations of markers in evaluate()")
