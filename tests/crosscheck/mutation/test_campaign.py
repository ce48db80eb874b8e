"""Campaigns on the small case with a fake engine: faults are noticed, a blind case is told that it is; every ending of
a mutant has an outcome in the score, and docs/mutations.md has the catalogue as it is.
"""

import json
import math
from pathlib import Path

import pytest
from rich.console import Console

from crosscheck.judging.verdict import STATUSES, Status
from crosscheck.library.case import CaseError
from crosscheck.library.find import Case, load_case, resolve, shipped_cases
from crosscheck.library.mutations import CATALOGUE
from crosscheck.mutation.answers import FAULTS
from crosscheck.mutation.campaign import RECORDS, SCORES, run_campaign
from crosscheck.mutation.invariances import INVARIANCES
from crosscheck.mutation.mutants import PassedOver, mutants_of, same_to_rounding
from crosscheck.mutation.score import Mutant, MutationScore, Outcome, ShownIn, mean, mutation_score, outcome
from crosscheck.mutation.subject import subject
from crosscheck.terminal.mutation import print_mutation_scores
from tests.crosscheck.sessions import CASE, PROVIDER, copy_case, run_here
from tests.repo.project import ROOT

BLIND = """
[[variant]]
name = "rigid"
engines = ["fine", "stepper"]

[[comparison]]
name = "a released pendulum's total energy stays zero"
variant = "rigid"
goals = { "energy.total" = 1e-6 }
"""


def campaign(case: Case, out: Path, engine: str = "fine") -> MutationScore:
    out.mkdir(exist_ok=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("crosscheck.mutation.campaign.run_planned", run_here)
        (score,) = run_campaign([case], out, engine=engine, provider=PROVIDER)
    return score


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("campaign")


@pytest.fixture(scope="module")
def seeing(out: Path) -> MutationScore:
    return campaign(load_case(CASE), out)


def test_the_small_case_notices_its_faults(seeing: MutationScore) -> None:
    noticed = {mutant.mutation for mutant in seeing.mutants if mutant.outcome == "noticed"}
    assert {"mass", "com", "com_sign", "gravity_sign", "gravity_size", "gravity_dropped", "node_position"} <= noticed
    assert {"load_reaction", "orientation_transposed", "velocity_axes", "late", "energy_gravity"} <= noticed
    assert seeing.score is not None and seeing.score >= 0.95
    assert seeing.channels["marker:tip.position"].noticed > 5


def test_what_no_channel_could_show_is_passed_over_with_its_physics(seeing: MutationScore) -> None:
    reasons = {each.mutation: each.reason for each in seeing.passed_over}
    assert "only names the coordinate" in reasons["hinge_axis"]
    assert reasons["wheel_load_reaction"] == "it changes nothing in this run"


def test_the_scores_are_in_a_file_and_the_records_serve_again(seeing: MutationScore, out: Path) -> None:
    stored = json.loads((out / SCORES).read_text(encoding="utf-8"))
    assert stored["format"] == 1
    assert stored["cases"][0]["score"] == seeing.score
    assert {each["outcome"] for each in stored["cases"][0]["mutants"]} <= {
        "noticed", "missed", "no mutant", "not judged",
    }  # fmt: skip
    runs = (out / RECORDS).read_text(encoding="utf-8").count('"record":"run"')
    assert campaign(load_case(CASE), out) == seeing
    assert (out / RECORDS).read_text(encoding="utf-8").count('"record":"run"') == runs


def test_a_blind_case_is_told_what_it_missed(tmp_path: Path) -> None:
    score = campaign(load_case(copy_case(tmp_path, BLIND)), tmp_path / "out")
    assert score.score is not None and score.score < 0.95
    assert {"mass", "com"} <= {each.mutation for each in score.missed}
    console = Console(record=True, width=200)
    assert print_mutation_scores(console, [score], verbose=True) == 1
    text = console.export_text()
    assert "missed: pendulum/single: mass of rod" in text and "passed over" in text


def test_an_engine_that_is_absent_leaves_nothing_judged_and_no_score(tmp_path: Path) -> None:
    run_file = BLIND.replace('"stepper"', '"absent"')
    score = campaign(load_case(copy_case(tmp_path, run_file)), tmp_path / "out", engine="absent")
    assert score.score is None and score.not_judged
    assert print_mutation_scores(Console(quiet=True), [score]) == 1


UNJUDGED = """
[[variant]]
name = "other"
engines = ["sloppy"]
"""


def test_a_case_that_judges_nothing_of_an_engine_is_refused(tmp_path: Path) -> None:
    case = load_case(copy_case(tmp_path, UNJUDGED + BLIND))
    assert subject(case, "fine").variant.name == "rigid"
    with pytest.raises(CaseError, match="no comparison judges a variant that engine sloppy runs"):
        subject(case, "sloppy")


@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_mutants_of_shipped_cases_are_scenes() -> None:
    for case in resolve(("torque_driven", "slider_crank", "flying_spaghetti")):
        found = mutants_of(subject(case, "native"))
        assert len(found.mutants) >= 5, case.name
        assert all(each.reason for each in found.passed_over)


def test_a_beam_in_pieces_has_no_modes_of_the_whole() -> None:
    (case,) = resolve(("flying_spaghetti",))
    found = mutants_of(subject(case, "native"))
    reasons = {each.mutation: each.reason for each in found.passed_over}
    assert "takes the body apart" in reasons["mode_rotation"]
    assert not any(control.mutation.startswith("mode_") for control in found.mutants.values())


def test_rounding_is_no_mutation_and_one_per_cent_is() -> None:
    scene = load_case(CASE).scene(load_case(CASE).run.variants[0])
    assert same_to_rounding(scene, scene)
    assert same_to_rounding((1.0, 1e-17), (1.0 + 1e-15, 0.0))
    assert not same_to_rounding(((1.0, 0.0), (0.0, 1e16)), ((2.0, 0.0), (0.0, 1e16)))
    assert (
        not same_to_rounding(1.0, 1.01) and not same_to_rounding((1.0,), (1.0, 1.0)) and not same_to_rounding("a", 1.0)
    )


@pytest.mark.slow
def test_the_library_notices_faults(tmp_path: Path) -> None:
    scores = run_campaign(shipped_cases(), tmp_path)
    assert print_mutation_scores(Console(), scores) == 0


@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
def test_where_closures_say_it_begins_the_scene_s_value_is_no_fault() -> None:
    """The prescribed crank moves the slider and, since hinges close a loop before modes, the rod; a free one counts."""
    (case,) = resolve(("slider_crank_simeon",))
    found = mutants_of(subject(case, "native"))
    alike = {each.target for each in found.passed_over if "the closures say" in each.reason}
    assert alike == {"guide", "pin"}
    assert not any(name.startswith("initial_") for name in found.mutants)
    (case,) = resolve(("closed_chains/four_bar",))
    found = mutants_of(subject(case, "native"))
    assert not [each for each in found.passed_over if "the closures say" in each.reason]
    assert {"initial_rate of drive", "initial_rate of pin", "initial_place of pin"} <= set(found.mutants)


def shown(status: Status, E: float | None = 0.0, goal: float = 1e-6) -> ShownIn:
    return ShownIn(status=status, E=E, U=1e-9, goal=goal)


@pytest.mark.parametrize(
    ("statuses", "expected"),
    [
        (("differ", "agree"), "noticed"),
        (("differ", "did not run"), "noticed"),
        (("diverged", "diverged"), "noticed"),
        (("agree", "unresolved"), "missed"),
        (("unresolved",), "missed"),
        (("agree", "refused"), "missed"),
        (("refused",), "no mutant"),
        (("failed",), "no mutant"),
        (("did not finish",), "not judged"),
        (("agree", "crashed"), "not judged"),
        (("did not run",), "not judged"),
        ((), "not judged"),
    ],
)
def test_what_came_of_a_mutant(statuses: tuple[Status, ...], expected: Outcome) -> None:
    assert outcome({str(i): shown(status) for i, status in enumerate(statuses)})[0] == expected


@pytest.mark.parametrize("status", STATUSES)
def test_no_single_status_is_noticed_but_a_difference_or_a_divergence(status: Status) -> None:
    assert (outcome({"a": shown(status)})[0] == "noticed") == (status in ("differ", "diverged"))


def test_a_mutant_that_had_many_times_the_time_is_noticed() -> None:
    assert outcome({"a": shown("did not finish")}, patient=True) == ("noticed", True)
    assert outcome({"a": shown("crashed")}, patient=True)[0] == "not judged"


@pytest.mark.parametrize(
    ("E", "beyond"), [(2e-6, True), (1e-6, False), (1e-7, False), (math.inf, True), (math.nan, False), (None, False)]
)
def test_beyond_a_goal_is_more_than_it(E: float | None, beyond: bool) -> None:
    assert outcome({"a": shown("differ", E)}) == ("noticed", beyond)


def mutant(name: str, what: Outcome, **channels: Status) -> Mutant:
    return Mutant(
        mutation=name, target="", of="scene", outcome=what, beyond_goal=False, reason="",
        channels={key: shown(status) for key, status in channels.items()},
    )  # fmt: skip


def test_only_what_was_judged_counts() -> None:
    mutants = [
        mutant("one", "noticed", a="differ", b="agree"), mutant("two", "missed", a="agree", b="agree"),
        mutant("three", "not judged", a="crashed"), mutant("four", "no mutant", a="refused"),
    ]  # fmt: skip
    found = mutation_score("case", "variant", "engine", mutants, [PassedOver(mutation="five", target="", reason="why")])
    assert (found.score, found.score_at_goals) == (0.5, 0.0)
    assert {name: (channel.noticed, channel.mutants) for name, channel in found.channels.items()} == {
        "a": (1, 2),
        "b": (0, 2),
    }
    assert [each.mutation for each in found.missed] == ["two"]
    assert [each.mutation for each in found.not_judged] == ["three"]


def test_a_case_without_mutants_has_no_score_and_is_no_part_of_the_mean() -> None:
    empty = mutation_score("case", "variant", "engine", [], [])
    one_of_two = [mutant("one", "noticed", a="differ"), mutant("two", "missed")]
    half = mutation_score("case", "variant", "engine", one_of_two, [])
    assert empty.score is None and empty.score_at_goals is None
    assert mean([empty.score, half.score]) == 0.5
    assert mean([None]) is None and mean([]) is None


PAGE = (ROOT / "docs" / "mutations.md").read_text(encoding="utf-8")


def test_the_page_has_every_row_and_no_other() -> None:
    expected = [f"| `{each.name}` | {each.what} | {each.slip} |" for each in (*CATALOGUE.values(), *FAULTS)]
    expected += [f"| `{invariance.name}` | {invariance.what} |" for invariance in INVARIANCES]
    assert [line for line in PAGE.splitlines() if line.startswith("| `")] == expected
