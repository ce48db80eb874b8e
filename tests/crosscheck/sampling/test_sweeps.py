"""Whole sweeps with the fake engines: reproducible, resumable, nothing counted twice, nothing lost without a word."""

import csv
import functools
import json
import math
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest
from typer.testing import CliRunner

from crosscheck import cli
from crosscheck.library.case import CaseError
from crosscheck.running.pool import run_jobs
from crosscheck.running.scheduler import Event, Limits, Work
from crosscheck.sampling.outputs import summarise
from crosscheck.sampling.run import Sampled, run_sweep
from flexmb.scene.files import dumps
from tests.crosscheck.sessions import CASE, PROVIDER
from tests.flexmb.scene.bad_scenes import satellite

LENGTH_M = 1.0  # of the rod, to the marker
HEAD = f"""
title = "Where the rod is"
scene = "{CASE / "scene.toml"}"
duration_s = 1.0
samples = 11
engines = ENGINES
efforts = [EFFORTS]
number = 6
seed = 3
"""
ANGLE = """
[[parameter]]
name = "angle"
path = "hinges.pivot.rotation.angle_rad"
distribution = "normal"
mean = 0.5
sd = 0.1
"""
HEIGHT = """
[[quantity]]
name = "height"
channel = "marker:tip.position"
component = "y"
value = "initial"
"""


def write(folder: Path, *engines: str, head: str = HEAD, parameter: str = ANGLE, quantity: str = HEIGHT) -> Path:
    efforts = [f'{{ engine = "{name}", kind = "tolerance", method = "dop853", value = 1e-8 }}' for name in engines]
    text = head.replace("ENGINES", json.dumps(engines)).replace("EFFORTS", ", ".join(efforts))
    file = folder / "sweep.toml"
    file.write_text(text + parameter + quantity, encoding="utf-8")
    return file


def here_and_backwards(work: Work):
    """A scheduler without processes that begins at the end."""
    for number in reversed(range(len(work.jobs))):
        found: list[object] = []
        work.function(work.jobs[number], found.append)
        yield from (Event(number, "emitted", content) for content in found)
        yield Event(number, "ended")


def run(file: Path, out: Path, **options: object) -> Sampled:
    out.mkdir(parents=True, exist_ok=True)
    return run_sweep(file, out, **{"provider": PROVIDER, "scheduler": here_and_backwards, **options})


def table(out: Path, name: str = "samples.csv") -> list[dict[str, str]]:
    with (out / name).open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_every_sample_has_its_own_value_and_the_quantity_that_follows_from_it(tmp_path: Path) -> None:
    done = run(write(tmp_path, "fine"), tmp_path / "out")
    lines = table(tmp_path / "out")
    assert [int(line["sample"]) for line in lines] == list(range(6)) and len({line["angle"] for line in lines}) == 6
    for line in lines:
        assert line["status"] == "finished"
        assert float(line["height"]) == pytest.approx(LENGTH_M * math.sin(float(line["angle"])), rel=1e-12)
    assert summarise(done).ok


def test_an_engine_is_looked_for_once_and_not_for_every_sample(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Entry points of distributions take 20 ms to read: a plan of a hundred thousand samples took half an hour."""
    asked: list[str] = []
    monkeypatch.setattr("crosscheck.sampling.run.home", lambda engine: asked.append(engine) or "")
    done = run_sweep(write(tmp_path, "fine"), tmp_path / "out", provider=PROVIDER, scheduler=lambda *_: (_ for _ in ()))
    assert len(done.records) > 1 and asked == ["fine"]


def test_results_do_not_depend_on_workers_and_order(tmp_path: Path) -> None:
    file = write(tmp_path, "fine")
    run(file, tmp_path / "backwards")
    run(file, tmp_path / "pool", scheduler=run_jobs, limits=Limits(workers=2))
    tables = [(tmp_path / name / "samples.csv").read_bytes() for name in ("backwards", "pool")]
    assert tables[0] == tables[1]


def test_a_killed_sweep_resumes_and_a_larger_one_keeps_what_there_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    diary, out = tmp_path / "diary", tmp_path / "out"
    monkeypatch.setenv("FAKE_ENGINE_DIARY", str(diary))
    file = write(tmp_path, "diarist")

    def runs() -> int:
        count = len(diary.read_text(encoding="utf-8").splitlines()) if diary.exists() else 0
        diary.unlink(missing_ok=True)
        return count

    run(file, out)
    first = table(out)
    assert runs() == 6
    text = (out / "samples.jsonl").read_bytes()
    (out / "samples.jsonl").write_bytes(text[: text.rindex(b'{"record":"sample"') + 50])
    run(file, out)
    assert runs() == 1 and table(out) == first
    more = file.read_text(encoding="utf-8").replace("number = 6", "number = 8")
    file.write_text(more, encoding="utf-8")
    run(file, out)
    assert runs() == 2 and table(out)[:6] == first
    file.write_text(more.replace('"initial"', '"final"'), encoding="utf-8")
    run(file, out)
    assert runs() == 8  # another quantity is another question
    run(file, out, fresh=True)
    assert runs() == 8


def test_samples_without_a_result_are_counted_and_listed_and_no_part_of_the_statistics(tmp_path: Path) -> None:
    """Masses of which some are negative, an engine that dies, one that gives up half way."""
    mass = '[[parameter]]\npath = "bodies.rod.mass_kg"\ndistribution = "values"\nvalues = [1.0, -1.0]\n'
    grid = HEAD.replace("number = 6\n", 'sampling = "grid"\n')
    file = write(tmp_path, "fine", "crasher", "diverger", head=grid, parameter=mass)
    summary = summarise(run(file, tmp_path / "out", scheduler=run_jobs, limits=Limits(workers=2)))
    assert summary.statuses == {"finished": 1, "crashed": 1, "diverged": 1, "failed": 3}
    assert [(distribution.engine, distribution.count) for distribution in summary.distributions] == [("fine", 1)]
    messages = {(failure.sample, failure.engine): failure.message for failure in summary.failures}
    assert "exit code 139" in messages[0, "crasher"]
    assert "diverged" in messages[0, "diverger"] or "the step fell below" in messages[0, "diverger"]
    assert all("mass_kg" in messages[1, engine] for engine in ("fine", "crasher", "diverger"))
    assert not summary.ok


def test_an_interrupted_sweep_leaves_a_table_of_what_was_done_by_a_name_that_says_so(tmp_path: Path) -> None:
    """And no table and no summary of the whole sweep that was there before."""
    file = write(tmp_path, "fine")
    run(file, tmp_path / "out")
    (tmp_path / "out" / "summary.json").write_text("{}", encoding="utf-8")

    def interrupted(work: Work):
        yield from (event for event in here_and_backwards(replace(work, jobs=work.jobs[:2])))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(file, tmp_path / "out", scheduler=interrupted, fresh=True)
    left = {each.name for each in (tmp_path / "out").iterdir()}
    assert "samples.unfinished.csv" in left and not {"samples.csv", "summary.json"} & left
    assert sorted(line["sample"] for line in table(tmp_path / "out", "samples.unfinished.csv")) == ["0", "1"]
    run(file, tmp_path / "out")
    assert not (tmp_path / "out" / "samples.unfinished.csv").exists()
    assert len(table(tmp_path / "out")) == 6


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("angle_rad", "angel_rad"), 'there is no "angel_rad": did you mean "angle_rad"?'),
        (("hinges.pivot", "hinges.pivto"), 'did you mean "pivot"?'),
        (("angle_rad", "angle_rad.x"), "end the path before it"),
        (("hinges.pivot.rotation.angle_rad", "hinges.pivot.rotation"), "give the path of a number"),
        (("marker:tip.position", "marker:tap.position"), 'no marker "tap": did you mean "tip"?'),
        (("marker:tip.position", "speed"), 'no channel "speed"'),
        (("sd = 0.1", "sd = -0.1"), "sd positive"),
        (("sd = 0.1", "sd = 1.7e308"), "drawn overflow: give a narrower distribution"),
        (("sd = 0.1", "s = 0.1"), "$.parameter[0]: Object contains unknown field `s`"),
        (("number = 6", "number = 0"), "0 samples make no sense"),
        (("number = 6", 'number = 6\nsampling = "grid"'), "leave it out"),
        (("duration_s = 1.0", ""), "give `duration_s` and `samples`"),
        (("samples = 11", "samples = 1"), "a run cannot have 1 samples"),
        (("samples = 11", "samples = 9007199254740993"), "a run cannot have 9007199254740993 samples"),
        (("duration_s = 1.0", "duration_s = 1e300"), "give 1e-09 to 1e+07 seconds"),
        (("duration_s = 1.0", "duration_s = nan"), "give 1e-09 to 1e+07 seconds"),
        (('method = "dop853"', 'method = "dopri"'), '$.efforts[0].method: fine has no method "dopri"'),
        (('engines = ["fine"]', 'engines = ["fine", "fien"]'), 'there is no engine "fien"'),
        (("angle_rad", "angle_rad.0"), "end the path before it"),
        (('component = "y"', 'component = "w"'), "marker:tip.position has no component 'w'"),
        (('component = "y"', "component = 3"), "give x, y, z, or a number from 0 to 2"),
        (("marker:tip.position", "load:pivto.torque"), 'no load "pivto": did you mean "pivot"?'),
        (("scene.toml", "no.toml"), "no.toml"),
        (("scene =", "# scene ="), "give `case` or `scene`"),
        (('engine = "fine"', 'engine = "fin"'), "no effort of an engine here: fin"),
    ],
)
@pytest.mark.filterwarnings("ignore:overflow encountered")
def test_a_file_that_makes_no_sense_is_refused_before_anything_runs(
    tmp_path: Path, change: tuple[str, str], words: str
) -> None:
    file = write(tmp_path, "fine")
    text = file.read_text(encoding="utf-8")
    assert change[0] in text
    file.write_text(text.replace(*change), encoding="utf-8")
    with pytest.raises(CaseError) as refused:
        run(file, tmp_path / "out")
    message = str(refused.value).replace("\n     ->", ":")
    assert words in message
    assert message.startswith(f"{file}: ")
    assert not (tmp_path / "out" / "samples.jsonl").exists()


def test_a_count_takes_whole_numbers_in_every_sample(tmp_path: Path) -> None:
    """The first sample of this grid is sound, the second is not."""
    head = HEAD.replace("number = 6\n", 'sampling = "grid"\n').replace(str(CASE / "scene.toml"), "scene.toml")
    (tmp_path / "scene.toml").write_text(dumps(satellite().scene()), encoding="utf-8")
    count = 'distribution = "values"\nvalues = [4, 4.5]\n'
    parameter = f'[[parameter]]\npath = "bodies.boom.elements"\n{count}'
    quantity = HEIGHT.replace("marker:tip.position", "energy.total").replace('component = "y"\n', "")
    file = write(tmp_path, "fine", head=head, parameter=parameter, quantity=quantity)
    with pytest.raises(CaseError, match=r"sweep\.toml: .* is a count: 4\.5 is not a whole number"):
        run(file, tmp_path / "out")


def test_the_command_says_what_came_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    quick = functools.partial(run_sweep, provider=PROVIDER)
    backwards = {"scheduler": here_and_backwards}
    monkeypatch.setattr("crosscheck.sampling.run.run_sweep", lambda *words, **more: quick(*words, **(more | backwards)))
    out = tmp_path / "out"
    good = CliRunner().invoke(cli.app, ["sweep", str(write(tmp_path, "fine")), "--out", str(out)])
    assert good.exit_code == 0 and "6 samples: 6 finished" in good.output, good.output
    summary = msgspec.json.decode((out / "summary.json").read_bytes())
    assert summary["distributions"][0]["mean"]["standard_error"] > 0.0
    bad = CliRunner().invoke(cli.app, ["sweep", str(write(tmp_path, "absent")), "--out", str(out)])
    assert bad.exit_code == 2 and "install the extra `absent`" in " ".join(bad.output.split()), bad.output
    nothing = CliRunner().invoke(cli.app, ["sweep", str(tmp_path / "none.toml"), "--out", str(out)])
    assert nothing.exit_code == 2 and "none.toml" in nothing.output
