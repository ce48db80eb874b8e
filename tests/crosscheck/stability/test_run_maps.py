"""Whole maps: verdicts that can fail, failed cells in colours of their own, resuming, and the command."""

from dataclasses import replace
from pathlib import Path

import msgspec
import pytest
from matplotlib.image import imread
from typer.testing import CliRunner

from crosscheck import cli
from crosscheck.records import made_by
from crosscheck.running.scheduler import Limits, Work
from crosscheck.stability import run
from crosscheck.stability.boundary import judge
from crosscheck.stability.catalogue import stability_maps
from crosscheck.stability.map_records import CellRecord, cells_of, identity, read
from crosscheck.stability.picture import STATUSES, draw
from crosscheck.stability.run import Finished, run_map
from crosscheck.stability.verdict_file import read_verdicts
from tests.crosscheck.sessions import here
from tests.crosscheck.stability import synthetic
from tests.crosscheck.stability.synthetic import CIRCLE, PROVIDER, shifted


def run_it(name: str, folder: Path, **options: object) -> Finished:
    return run_map(name, folder / f"{name}.jsonl", provider=PROVIDER, **{"scheduler": here, **options})


def test_a_true_overlay_is_met_and_a_wrong_one_is_noticed(tmp_path: Path) -> None:
    """The finest cells are 1/64 m: a circle shifted by less than one is within one cell, by three it is not."""
    true, close, wrong = (run_it(name, tmp_path).verdict for name in ("circle", "close", "wrong"))
    assert (true.status, true.distance) == ("agree", 0)
    assert (close.status, close.distance) == ("agree", 1)
    assert wrong.status == "differ" and 2 <= wrong.distance <= 4
    assert "expected" in wrong.worst


def test_an_overlay_elsewhere_altogether_is_infinitely_far(tmp_path: Path) -> None:
    done = run_it("circle", tmp_path)
    nowhere = judge(replace(CIRCLE, overlay=shifted(10.0)), done.mesh, done.records)
    assert (nowhere.status, nowhere.distance) == ("differ", -1)


def test_a_bound_allows_better_and_refuses_worse(tmp_path: Path) -> None:
    """Stable is better: a bound may call stable places unstable, not unstable ones stable."""
    done = run_it("circle", tmp_path)
    for radius, status in ((0.3, "agree"), (0.9, "differ")):
        smaller = replace(CIRCLE.overlay, predict=lambda x, y, r=radius: (x**2 + y**2) ** 0.5 - r, bound=True)
        assert judge(replace(CIRCLE, overlay=smaller), done.mesh, done.records).status == status


def test_cells_that_fail_stop_or_die_are_colours_of_their_own(tmp_path: Path) -> None:
    """A death says nothing about the method: whatever a map takes failures for, it is never green."""
    done = run_it("corner", tmp_path, scheduler=run.run_jobs, limits=Limits(workers=2))
    found = {record.status for record in done.records.values()}
    assert found == {"measured", "failed", "did not finish", "did not run"}
    died = {cell: record for cell, record in done.records.items() if record.x > 0.8 and record.y > 0.8}
    assert died and all(record.message == "the worker process died (exit code 3)" for record in died.values())
    assert {record.status for record in died.values()} == {"did not run"}
    assert all(judge(replace(done.map, failure=k), done.mesh, done.records).status == "did not run" for k in (0, 1))
    raised = next(record for record in done.records.values() if record.x > 0.8 and record.y < 0.8)
    assert raised.message == "ArithmeticError: no such state"
    assert done.verdict.status == "did not run"
    pixels = imread(draw(done, tmp_path / "corner.png"))[..., :3]
    for status in ("failed", "did not finish"):
        colour = [int(STATUSES[status][n : n + 2], 16) / 255 for n in (1, 3, 5)]
        assert (abs(pixels - colour).max(axis=-1) < 0.01).sum() > 1000
    alive = done.records | {cell: msgspec.structs.replace(each, status="failed") for cell, each in died.items()}
    assert judge(done.map, done.mesh, alive).status == "differ"  # no failure is right on this map
    as_unstable, as_stable = (judge(replace(done.map, failure=k), done.mesh, alive) for k in (1, 0))
    assert (as_unstable.status, as_stable.status) == ("agree", "differ")  # the corner is outside the circle


def test_what_did_not_run_is_never_green_and_asked_for_again(tmp_path: Path) -> None:
    done = run_it("absent", tmp_path)
    assert done.verdict.status == "did not run" and not done.verdict.ok
    assert run_it("absent", tmp_path).verdict.cells == {"did not run": 64}
    assert len([each for each in read(tmp_path / "absent.jsonl") if isinstance(each, CellRecord)]) == 128


def test_cells_that_exceed_a_limit_did_not_run_and_are_asked_for_again(tmp_path: Path) -> None:
    """Whatever the machine could not do says nothing about the map."""
    done = run_it("slow", tmp_path, scheduler=run.run_jobs, limits=Limits(workers=2, time_s=1.0))
    stopped = [record for record in done.records.values() if record.status != "measured"]
    assert stopped and {record.status for record in stopped} == {"did not run"}
    assert all("stopped at its limit of 1 s" in record.message for record in stopped)
    assert not done.verdict.ok
    kept = cells_of(read(tmp_path / "slow.jsonl"), identity(done.map))
    assert {record.cell for record in stopped}.isdisjoint(kept)


def test_a_map_without_evidence_is_not_green(tmp_path: Path) -> None:
    done = run_it("silent", tmp_path)
    assert (done.verdict.status, done.verdict.ok) == ("did not run", False)


def test_cells_of_other_sources_are_measured_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An edit in any file that the map's scene or measure reaches, in the mechanics as in the map itself."""
    map_of = stability_maps()["free_spin"]
    first, of_synthetic = identity(map_of), identity(CIRCLE)
    text = made_by._text
    monkeypatch.setattr(made_by, "_text", lambda file: "edited" if file.name == "dynamics.py" else text(file))
    made_by._key.cache_clear()
    assert identity(map_of) != first
    assert identity(CIRCLE) == of_synthetic
    monkeypatch.undo()
    made_by._key.cache_clear()
    assert identity(map_of) == first


def test_maps_of_other_codes_depend_on_their_adapters() -> None:
    measure = stability_maps()["integrator_mujoco_euler"].measure.__module__
    assert "crosscheck.engines.mujoco.model" in made_by.sources([measure]).files


def test_a_run_that_was_killed_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = run_it("circle", tmp_path)
    file = tmp_path / "circle.jsonl"
    text = file.read_bytes()
    (tmp_path / "cut.jsonl").write_bytes(text[: len(text) // 2])  # in the middle of a line
    known = len([each for each in read(tmp_path / "cut.jsonl") if isinstance(each, CellRecord)])
    seen: list[int] = []

    def counting(job, emit) -> None:
        seen.append(1)
        run.run_cell(job, emit)

    def scheduler(work: Work):
        return here(replace(work, function=counting))

    again = run_map("circle", tmp_path / "cut.jsonl", provider=PROVIDER, scheduler=scheduler)
    assert len(seen) == len(whole.records) - known > 0
    assert again.verdict.cells == whole.verdict.cells and again.mesh.labels == whole.mesh.labels
    seen.clear()
    run_map("circle", tmp_path / "cut.jsonl", provider=PROVIDER, scheduler=scheduler)
    assert not seen


def test_the_command_writes_pictures_records_and_verdicts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "PROVIDER", PROVIDER)
    runner, out = CliRunner(), tmp_path / "out"
    words = ["stability", "circle", "--depth", "2", "--jobs", "1", "--out", str(out)]
    result = runner.invoke(cli.app, words)
    assert result.exit_code == 0, result.output
    assert {"circle.jsonl", "circle.svg", "maps.json"} <= {file.name for file in out.iterdir()}
    assert (out / "circle.svg").stat().st_size < 200_000
    assert runner.invoke(cli.app, ["stability", "wrong", "--jobs", "1", "--out", str(out)]).exit_code == 1
    verdicts = {verdict.map: verdict.ok for verdict in read_verdicts(out / "maps.json")}
    assert verdicts == {"circle": True, "wrong": False}
    unknown = runner.invoke(cli.app, ["stability", "circel"])
    assert unknown.exit_code == 2 and 'did you mean "circle"?' in unknown.output
    listed = runner.invoke(cli.app, ["stability", "list"], env={"COLUMNS": "200"})
    assert listed.exit_code == 0 and "the circle" in listed.output


def test_every_map_says_what_it_is() -> None:
    """Names are unique and file names; sources and sentences are there; predictions take arrays of any shape."""
    known = stability_maps()
    assert synthetic.maps().keys() != known.keys()
    for name, what in known.items():
        assert name == what.name and name.isidentifier()
        assert what.overlay.source and what.shows.endswith(".") and what.title
