"""Making references: what is refused, what is written, and that nothing is half written."""

import os
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crosscheck.judging.results import Result
from crosscheck.library.case import CaseError
from crosscheck.library.find import load_case
from crosscheck.library.reference import KNOWLEDGE, VALUES, current_reference, load_reference
from crosscheck.references.files import NO_WORK
from crosscheck.references.regenerate import Regenerated
from crosscheck.references.regenerate import regenerate as make_again
from crosscheck.running.pool import run_jobs
from crosscheck.running.scheduler import Limits, Scheduler
from crosscheck.running.sweep import run_planned
from tests.crosscheck.sessions import CASE, PROVIDER, copy_case, copy_of, edit, run_here

VARIANT = """
[[variant]]
name = "rigid"
engines = ["fine", "stepper", "biased", "absent"]

[[comparison]]
name = "all"
variant = "rigid"
engines = ["fine", "stepper"]
goals = { "marker:tip.position" = 1e-6 }
"""
RECIPE = """
[reference]
variant = "rigid"
samples = 11

[[reference.route]]
engine = "fine"

[[reference.route]]
engine = "stepper"
"""
EXACT = """
[[reference.route]]
exact = "exact.py"
"""
ANCHOR = """
[[anchor]]
channel = "marker:tip.position"
component = "{component}"
t_s = {t_s}
value = {value}
uncertainty = 1e-5
source = "an elliptic integral"
"""


@pytest.fixture(autouse=True, scope="module")
def without_workers() -> Iterator[None]:
    """Routes run in this process: only one test below needs workers."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("crosscheck.references.routes.run_planned", run_here)
        yield


def case_folder(folder: Path, recipe: str = RECIPE) -> Path:
    return copy_case(folder, VARIANT + recipe)


def regenerate(folder: Path, *, check: bool = False) -> Regenerated:
    return make_again(load_case(folder), check=check, provider=PROVIDER, limits=Limits(workers=1))


def refusal(folder: Path) -> str:
    """The message of a refusal; the folder's files are what they were."""
    before = {file: file.read_bytes() for file in folder.iterdir() if file.is_file()}
    with pytest.raises(CaseError) as refused:
        regenerate(folder)
    assert {file: file.read_bytes() for file in folder.iterdir() if file.is_file()} == before
    return str(refused.value)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A case with its reference."""
    folder = case_folder(tmp_path_factory.mktemp("made"))
    assert regenerate(folder).done == "written"
    return folder


@pytest.fixture
def copied(made: Path, tmp_path: Path) -> Path:
    """The same case, for changing."""
    return copy_of(made, tmp_path)


def test_a_reference_says_what_is_known(made: Path) -> None:
    reference = current_reference(load_case(made))
    np.testing.assert_array_equal(reference.times, np.linspace(0.0, 2.0, 21)[::2])
    known = reference.knowledge.channels["marker:tip.position"]
    assert 0.0 < known.uncertainty < 1e-6
    assert "U " in known.how
    assert "of fine" in known.how
    assert "E " in known.how
    assert "to stepper" in known.how
    assert all(0.0 < channel.uncertainty < np.inf for channel in reference.knowledge.channels.values())


def test_routes_run_where_the_scheduler_is(copied: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []

    def here(*given: Any, scheduler: Scheduler, **others: Any) -> None:
        seen.append(scheduler)
        run_here(*given, **others)

    monkeypatch.setattr("crosscheck.references.routes.run_planned", here)
    elsewhere = partial(run_jobs)
    make_again(load_case(copied), check=True, provider=PROVIDER, limits=Limits(workers=1), scheduler=elsewhere)
    assert seen == [elsewhere]


def test_a_reference_that_is_reproduced_is_left_as_it_is(copied: Path) -> None:
    before = {name: (copied / name).stat().st_mtime_ns for name in (VALUES, KNOWLEDGE)}
    assert regenerate(copied).done == "confirmed"
    assert regenerate(copied, check=True).done == "confirmed"
    assert {name: (copied / name).stat().st_mtime_ns for name in before} == before


def test_a_reference_keeps_the_work_of_its_runs_and_notices_other_work(copied: Path) -> None:
    """Counts are those of the machine's arithmetic, so a tenth is alike; more is told and written anew."""
    work = load_reference(copied).knowledge.work
    assert {run.partition(",")[0] for run in work} == {"fine (rigid)", "stepper (rigid)"}
    run, counts = next(iter(work.items()))
    assert counts.evaluations > 0
    for share, done in ((1.05, "confirmed"), (0.5, "would be written")):
        text = (copied / KNOWLEDGE).read_text(encoding="utf-8")
        line = next(line for line in text.splitlines() if line.startswith(f'"{run}"'))
        edit(copied / KNOWLEDGE, line, f'"{run}" = {{evaluations = {int(share * counts.evaluations)}}}')
        found = regenerate(copied, check=True)
        assert found.done == done
        edit(copied / KNOWLEDGE, f'"{run}" = {{evaluations = {int(share * counts.evaluations)}}}', line)
    assert f"{run} took {counts.evaluations // 2} evaluations, now {counts.evaluations}" in found.remark


def test_a_reference_without_counts_gets_them_and_keeps_its_values(copied: Path) -> None:
    before, values = load_reference(copied).knowledge, (copied / VALUES).read_bytes()
    text = (copied / KNOWLEDGE).read_text(encoding="utf-8")
    edit(copied / KNOWLEDGE, text[text.index("[work]") : text.index("[channels")], "")
    assert not load_reference(copied).knowledge.work
    assert "was not counted" in regenerate(copied).remark
    assert load_reference(copied).knowledge == before
    assert (copied / VALUES).read_bytes() == values


def test_runs_in_which_nothing_moves_have_no_counts_and_the_file_says_so(
    copied: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert NO_WORK not in (copied / KNOWLEDGE).read_text(encoding="utf-8")
    monkeypatch.setattr(Result, "rests", True)
    count = len(load_reference(copied).knowledge.work)
    assert f"the work of {count} runs is not counted any more" in regenerate(copied).remark
    assert not load_reference(copied).knowledge.work
    assert NO_WORK in (copied / KNOWLEDGE).read_text(encoding="utf-8")
    assert regenerate(copied).done == "confirmed"


def test_check_writes_nothing_and_workers_do_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = case_folder(tmp_path)
    monkeypatch.setattr("crosscheck.references.routes.run_planned", run_planned)
    assert regenerate(folder, check=True).done == "would be written"
    assert not (folder / VALUES).exists()
    assert not (folder / KNOWLEDGE).exists()


def test_routes_that_disagree_are_refused_with_channel_distance_and_time(tmp_path: Path) -> None:
    folder = case_folder(tmp_path, RECIPE.replace('"stepper"', '"biased"'))
    message = refusal(folder)
    line = next(line for line in message.splitlines() if "marker:tip.position" in line)
    assert "fine" in line
    assert "biased" in line
    assert " m apart at t = " in line
    assert "their uncertainties are " in line


def test_an_engine_is_not_independent_of_itself(tmp_path: Path) -> None:
    folder = case_folder(tmp_path, RECIPE.replace('"stepper"', '"fine"'))
    assert "no route is independent of fine" in refusal(folder)


def test_a_route_without_result_is_refused(tmp_path: Path) -> None:
    folder = case_folder(tmp_path, RECIPE.replace('"stepper"', '"absent"'))
    assert "route 2, absent, did not run" in refusal(folder)


def test_a_change_needs_its_reason_in_the_provenance(copied: Path) -> None:
    edit(copied / "scene.toml", "9.81", "9.812")
    with pytest.raises(CaseError, match="scene.toml or its variant was changed after"):
        current_reference(load_case(copied))
    message = refusal(copied)
    assert "is not replaced" in message
    assert "marker:tip.position differs by" in message
    assert "provenance.toml" in message
    edit(copied / "provenance.toml", "any textbook", "Another textbook, with another gravity: any")
    assert "changes beyond what was stated" in regenerate(copied).remark
    assert current_reference(load_case(copied)).times[-1] == 2.0


def test_a_reason_serves_for_one_change_only(copied: Path) -> None:
    """A correction of the provenance that comes with no change of numbers does not license a later one."""
    before = (copied / VALUES).read_bytes()
    edit(copied / "provenance.toml", "any textbook", "any good textbook")
    assert regenerate(copied, check=True).done == "would be written"
    assert "provenance.toml was changed since" in regenerate(copied).remark
    assert (copied / VALUES).read_bytes() == before
    assert regenerate(copied).done == "confirmed"
    edit(copied / "scene.toml", "9.81", "9.812")
    assert "is not replaced" in refusal(copied)


@pytest.mark.parametrize(("old", "new", "said"), [
    ("samples = 11\n", "samples = 11\nhorizon_s = 1.0\n", "the horizon is 1 s, it was 2 s"),
    ("samples = 11\n", 'samples = 11\nchannels = ["marker"]\n', "load:pivot.force is not there any more"),
    ('engine = "fine"', 'engine = "fine"\nefforts = [{ engine = "fine", kind = "tolerance", method = "dop853", '
     "values = [1e-3, 1e-4] }]", "is known to"),
], ids=["an earlier horizon", "fewer channels", "a wider uncertainty"])  # fmt: skip
def test_nothing_stated_is_taken_back(copied: Path, old: str, new: str, said: str) -> None:
    edit(copied / "run.toml", RECIPE, RECIPE.replace(old, new))
    assert said in refusal(copied)


def test_a_comment_in_the_scene_changes_nothing(copied: Path) -> None:
    edit(copied / "scene.toml", "gravity_m_s2", "# down\ngravity_m_s2")
    assert regenerate(copied).done == "confirmed"


def test_numbers_edited_by_hand_are_noticed(copied: Path) -> None:
    edit(copied / VALUES, "\n0.2", "\n0.20000000000000001")
    with pytest.raises(CaseError, match="was changed after"):
        load_reference(copied)
    assert "was changed after" in refusal(copied)


def tip(folder: Path, when: int) -> float:
    return float(load_reference(folder).channels["marker:tip.position"][when, 1])


def test_published_numbers_are_met_between_samples_too(copied: Path) -> None:
    """At 0.05 s the rod has fallen from rest by m g l t^2 / 2 I, and this changes by t^4 only."""
    edit(copied / "run.toml", "samples = 11\n", "samples = 21\n")
    assert regenerate(copied).done == "written"
    fall = 2.0 * 9.81 * 0.5 / (0.16766 + 2.0 * 0.5**2) * 0.05**2 / 2.0
    given = ANCHOR.format(component="y", t_s=0.05, value=-fall)
    text = (copied / "provenance.toml").read_text(encoding="utf-8")
    (copied / "provenance.toml").write_text(text + given, encoding="utf-8")
    assert regenerate(copied, check=True).remark == "reproduced; provenance.toml was changed since"


@pytest.mark.parametrize(("change", "said"), [
    ({"value": 0.5}, "find out which of the two is wrong"),
    ({"t_s": 3.0}, "is not within the reference"),
    ({"component": "w"}, 'there is no component "w"'),
])  # fmt: skip
def test_a_published_number_that_is_not_met_is_refused(copied: Path, change: dict[str, object], said: str) -> None:
    given = ANCHOR.format(**{"component": "y", "t_s": 0.6, "value": tip(copied, 3)} | change)
    text = (copied / "provenance.toml").read_text(encoding="utf-8")
    (copied / "provenance.toml").write_text(text + given, encoding="utf-8")
    assert said in refusal(copied)


CONSTANT = """
import numpy as np

def exact(times):
    still = np.zeros((len(times), 3))
    return {"momentum.linear": still + 7.0}
"""


@pytest.mark.parametrize(("text", "said"), [
    (None, "there is no such Python file"),
    ("exact = 1 / 0", "ZeroDivisionError"),
    ("def exakt(times): return {}", "no function exact"),
    ("def exact(times): return {'marker:tip.position': times[1:]}", "exact(times) failed"),
    ("def exact(times): return {'marker:tip.position': times * float('nan')}", "not finite"),
    (CONSTANT, "and exact.py, a closed form are"),
], ids=["missing", "raises", "misnamed", "misshapen", "NaN", "wrong"])  # fmt: skip
def test_a_closed_form_that_is_none_is_refused(tmp_path: Path, text: str | None, said: str) -> None:
    folder = case_folder(tmp_path, RECIPE.replace('[[reference.route]]\nengine = "stepper"\n', EXACT))
    if text is not None:
        (folder / "exact.py").write_text(text, encoding="utf-8")
    assert said in refusal(folder)


def test_both_files_or_none(copied: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk fails between the two files: what was there is there again."""
    edit(copied / "run.toml", "samples = 11\n", "samples = 21\n")
    replace, calls = os.replace, []

    def failing(source: Path, target: Path) -> None:
        calls.append(target)
        if len(calls) == 2:
            raise OSError(5, "Input/output error")
        replace(source, target)

    before = {file.name: file.read_bytes() for file in copied.iterdir()}
    monkeypatch.setattr("flexmb.output.files.os.replace", failing)
    with pytest.raises(OSError, match="Input/output error"):
        regenerate(copied)
    assert len(calls) == 3, "the third puts back what the first had replaced"
    assert {file.name: file.read_bytes() for file in copied.iterdir()} == before


def test_a_case_without_recipe_says_so() -> None:
    with pytest.raises(CaseError, match=r"it has no table \[reference\]"):
        regenerate(CASE)
