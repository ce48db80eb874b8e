"""Whole sessions with the fake engines: every status arises where it should, and only there."""

import msgspec
import pytest

from crosscheck.judging.outcome import SessionOutcome, conclude
from crosscheck.judging.results import collect
from crosscheck.records.archive import read
from crosscheck.records.kinds import RunRecord
from crosscheck.running.pool import run_jobs
from crosscheck.running.scheduler import Limits
from tests.crosscheck.sessions import CASE, compare_engines, copy_case, only, run_case, versus

GOALS = '"marker:tip" = 1e-6, "load" = 1e-6, "energy" = 1e-6'


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> SessionOutcome:
    return run_case(CASE, tmp_path_factory.mktemp("sound") / "records.jsonl")


def test_sound_engines_agree_on_every_channel(sound: SessionOutcome) -> None:
    compared = [verdict for verdict in sound.all if verdict.kind == "comparison"]
    assert {verdict.status for verdict in compared} == {"agree"}
    assert {"load:pivot.force", "load:pivot.torque", "energy.total", "marker:tip.orientation"} <= {
        verdict.channel for verdict in compared
    }
    assert all(0.0 <= verdict.U <= verdict.goal for verdict in compared)


def test_negative_controls_come_out_different_and_so_all_is_as_expected(sound: SessionOutcome) -> None:
    controls = [verdict for verdict in sound.all if verdict.kind == "control"]
    assert len(controls) == 2
    assert all(verdict.status == "differ" and verdict.ok for verdict in controls)
    assert sound.ok


def test_a_control_that_is_not_noticed_is_not_green(tmp_path) -> None:
    """A fault that the compared channel cannot show: the total energy of a pendulum released at height 0 stays 0."""
    text = (CASE / "run.toml").read_text(encoding="utf-8")
    folder = copy_case(tmp_path)
    blind = text.replace('goals = { "marker:tip.position" = 1e-6 }', 'goals = { "energy.total" = 1e-6 }')
    (folder / "run.toml").write_text(blind, encoding="utf-8")
    outcome = run_case(folder, tmp_path / "records.jsonl")
    assert {verdict.status for verdict in outcome.all if verdict.kind == "control"} == {"agree"}
    assert not outcome.ok


FAULTY = ("absent", "nonsense", "refuser", "crasher", "raiser", "diverger")


@pytest.fixture(scope="module")
def faulty(tmp_path_factory: pytest.TempPathFactory) -> SessionOutcome:
    """Two sound engines, a biased one, and all that give no result, in one session, in worker processes."""
    engines = ("fine", "stepper", "biased", *FAULTY)
    return compare_engines(tmp_path_factory.mktemp("faulty"), engines, scheduler=run_jobs, limits=Limits(workers=2))


def test_a_biased_engine_differs_from_both_others(faulty: SessionOutcome) -> None:
    assert only(faulty.all, "fine", "stepper").status == "agree"
    assert only(faulty.all, "fine", "biased").status == "differ"
    assert only(faulty.all, "stepper", "biased").status == "differ"
    assert not faulty.ok


def test_efforts_without_effect_leave_the_uncertainty_unknown(tmp_path) -> None:
    """With samples every 0.01 s all steps of the sloppy engine become 0.01 s: equal runs prove nothing."""
    folder = copy_case(tmp_path)
    text = (folder / "run.toml").read_text(encoding="utf-8")
    dense = text.replace("samples = 81", "samples = 401").replace("stepper", "sloppy")
    (folder / "run.toml").write_text(dense, encoding="utf-8")
    outcome = run_case(folder, tmp_path / "records.jsonl")
    compared = [verdict for verdict in outcome.all if verdict.kind == "comparison"]
    assert {verdict.status for verdict in compared} == {"unresolved"}


@pytest.mark.parametrize(
    ("engine", "status", "words"),
    [
        ("absent", "did not run", "install the extra"),
        ("nonsense", "did not run", 'no engine "nonsense": '),
        ("refuser", "refused", "revolute hinges are beyond it"),
        ("crasher", "crashed", "exit code 139"),
        ("raiser", "failed", "RuntimeError: the solver gave up on purpose"),
        ("diverger", "diverged", "diverged at t = 0.9 s: the step fell below"),
    ],
)
def test_an_engine_that_gives_no_result_is_never_green(
    faulty: SessionOutcome, engine: str, status: str, words: str
) -> None:
    for partner in ("fine", "stepper"):
        verdict = only(faulty.all, partner, engine)
        assert (verdict.status, verdict.ok) == (status, False)
        assert words in verdict.reason
    (absence,) = [absence for absence in faulty.absences if absence.engine == engine]
    assert absence.status == status


def test_nothing_compared_is_not_green(tmp_path) -> None:
    run_file = '\n[[variant]]\nname = "rigid"\nengines = ["fine"]\n'
    outcome = run_case(copy_case(tmp_path, run_file), tmp_path / "records.jsonl")
    assert (outcome.ok, outcome.headline) == (False, "Nothing was compared")


def test_a_killed_session_resumes_where_it_was(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    run_file = versus("diarist", "fine")
    diary, records = tmp_path / "diary", tmp_path / "records.jsonl"
    monkeypatch.setenv("FAKE_ENGINE_DIARY", str(diary))
    folder = copy_case(tmp_path, run_file)
    first = run_case(folder, records)
    efforts = list(dict.fromkeys(diary.read_text(encoding="utf-8").split("\n")[:-1]))
    assert len(efforts) == 4

    # A kill in the middle of the third of the diarist's records leaves two of them, and half a line.
    lines = records.read_bytes().splitlines(keepends=True)
    mine = [i for i, line in enumerate(lines) if b'"diarist"' in line and b'"record":"run"' in line]
    records.write_bytes(b"".join(lines[: mine[2]]) + lines[mine[2]][:100])
    diary.unlink()
    second = run_case(folder, records)
    assert set(diary.read_text(encoding="utf-8").split("\n")[:-1]) == set(efforts[2:])
    assert msgspec.json.encode(second.all) == msgspec.json.encode(first.all)

    diary.unlink()
    run_case(folder, records)
    assert not diary.exists()
    run_case(folder, records, fresh=True)
    assert set(diary.read_text(encoding="utf-8").split("\n")[:-1]) == set(efforts)


def test_a_changed_scene_is_run_again(tmp_path) -> None:
    folder, records = copy_case(tmp_path), tmp_path / "records.jsonl"
    run_case(folder, records)
    scene = folder / "scene.toml"
    scene.write_text(scene.read_text(encoding="utf-8").replace("mass_kg = 2.0", "mass_kg = 3.0"), encoding="utf-8")
    assert run_case(folder, records).ok
    scenes = {record.scene for record in read(records) if isinstance(record, RunRecord) and record.role == "main"}
    assert len(scenes) == 2


def test_a_longer_ladder_is_climbed_from_its_foot(tmp_path) -> None:
    """Else its result would have the new effort alone, and no uncertainty."""
    ladder = """
[[variant]]
name = "rigid"
engines = ["stepper", "fine"]
efforts = [{ engine = "stepper", kind = "step", method = "rk4", values = [0.0125, 0.00625] }]

[[comparison]]
name = "all"
variant = "rigid"
goals = { "marker:tip.position" = 1e-4 }
"""
    folder, records = copy_case(tmp_path, ladder), tmp_path / "records.jsonl"
    assert run_case(folder, records).ok
    short = (folder / "run.toml").read_text(encoding="utf-8")
    longer, coarser = short.replace("0.00625]", "0.00625, 0.003125]"), short.replace("0.0125, 0.00625", "0.025, 0.0125")
    for text in (longer, coarser, short):
        (folder / "run.toml").write_text(text, encoding="utf-8")
        assert run_case(folder, records).ok  # an effort that was another rung in between is run again


def test_a_missing_library_withdraws_earlier_results_and_comes_back(tmp_path) -> None:
    """Engine there, then gone, then there again: the verdict follows."""
    folder, records = copy_case(tmp_path), tmp_path / "records.jsonl"
    assert run_case(folder, records).ok
    kept = read(records)
    gone = next(record for record in kept if isinstance(record, RunRecord) and record.engine == "fine")
    blank = msgspec.structs.replace(gone, status="did not run", effort="", message="gone", times=None, channels={})
    assert not conclude(collect([*kept, blank])).ok
    with records.open("ab") as stream:
        stream.write(msgspec.json.encode(blank) + b"\n")
    assert run_case(folder, records).ok


def test_a_bad_scene_is_refused_before_anything_runs_and_says_where(tmp_path) -> None:
    folder = copy_case(tmp_path)
    scene = folder / "scene.toml"
    scene.write_text(scene.read_text(encoding="utf-8").replace("mass_kg = 2.0", "mass_kg = -2.0"), encoding="utf-8")
    outcome = run_case(folder, tmp_path / "records.jsonl")
    assert not outcome.ok
    assert {absence.status for absence in outcome.absences} == {"failed"}
    assert all("mass_kg" in absence.reason for absence in outcome.absences)
