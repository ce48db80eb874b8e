"""The command line: what it writes, what it says, and its exit codes."""

import functools
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from crosscheck import cli
from crosscheck.engines.contract import Run
from crosscheck.library.find import load_case
from crosscheck.running.installed import EngineState
from crosscheck.running.sweep import sweep
from crosscheck.verify.against_case import verify_csv
from tests.crosscheck.fake_engines import TOLERANCES, Pendulum
from tests.crosscheck.sessions import CASE, PROVIDER, copy_case, engines_here, here, sweep_here

WIDE = {"COLUMNS": "200"}


@pytest.fixture
def runner(monkeypatch: pytest.MonkeyPatch) -> CliRunner:
    """Runs the command line in this process, and fake engines in it too."""
    monkeypatch.setattr("crosscheck.running.sweep.sweep", sweep_here)
    monkeypatch.setattr("crosscheck.running.installed.require_engines", engines_here)
    monkeypatch.setattr(
        "crosscheck.verify.against_case.verify_csv",
        lambda *words, **more: verify_csv(*words, **more | {"provider": PROVIDER, "scheduler": here}),
    )
    monkeypatch.setattr(cli.common.console, "_width", 200)
    return CliRunner()


def test_run_writes_everything_and_ends_with_zero(
    runner: CliRunner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With worker processes, as users run it."""
    monkeypatch.setattr("crosscheck.running.sweep.sweep", functools.partial(sweep, provider=PROVIDER))
    result = runner.invoke(cli.app, ["run", str(CASE), "--out", str(tmp_path)], env=WIDE)
    assert result.exit_code == 0, result.output
    assert {"report", "report.html", "verdicts.json", "summary.md", "junit.xml", "records.jsonl"} <= {
        file.name for file in tmp_path.iterdir()
    }
    assert "All 15 verdicts are as expected" in result.output
    assert f"Report: {tmp_path / 'report' / 'index.html'}" in result.output
    again = runner.invoke(cli.app, ["report", str(tmp_path / "records.jsonl"), "--out", str(tmp_path / "b")], env=WIDE)
    assert again.exit_code == 0
    assert (tmp_path / "b" / "verdicts.json").read_bytes() == (tmp_path / "verdicts.json").read_bytes()


def ends(runner: CliRunner, words: list[object], code: int, said: str) -> None:
    """A command of these words ends with the exit code and says so."""
    result = runner.invoke(cli.app, [str(word) for word in words], env=WIDE)
    assert (result.exit_code, said in result.output) == (code, True), result.output


def test_messages_say_what_was_meant(runner: CliRunner, tmp_path: Path) -> None:
    """Of a case that is unknown or misspelt, of several where one is asked for, of files that are missing or none."""
    ends(runner, ["run", "nowhere", "--out", tmp_path], 2, "crosscheck list")
    ends(runner, ["run", "four_baer", "--out", tmp_path], 2, 'did you mean "four_bar"?')
    ends(runner, ["report", tmp_path / "none.jsonl"], 2, "")
    ends(runner, ["verify", "canonical", tmp_path / "my.csv"], 2, "name one of")
    (tmp_path / "run.toml").write_text("titel = 1\n", encoding="utf-8")
    result = runner.invoke(cli.app, ["run", str(tmp_path), "--out", str(tmp_path)], env=WIDE)
    assert (result.exit_code, "titel" in result.output, "scene" in result.output) == (2, True, False), result.output
    for word in ("Exit code", "resumes", "canonical", "report.html", "--accept", "--strict", "--time-limit"):
        ends(runner, ["run", "--help"], 0, word)


NUMBERS = [("--time-limit", limit, "give a positive number of seconds") for limit in ("nan", "inf", "0", "-1")]
NUMBERS += [("--jobs", count, "--jobs") for count in ("0", "-1", "many")]  # with none, a run would wait for ever


@pytest.mark.parametrize(("option", "number", "said"), NUMBERS)
@pytest.mark.parametrize("command", [("run", CASE), ("stability", "free_spin")], ids=["run", "stability"])
def test_limits_are_positive_numbers(
    runner: CliRunner, tmp_path: Path, command: tuple[object, ...], option: str, number: str, said: str
) -> None:
    ends(runner, [*command, option, number, "--out", tmp_path], 2, said)


def test_engines_are_listed_with_how_to_install_them(runner: CliRunner, monkeypatch: pytest.MonkeyPatch) -> None:
    states = [EngineState("fine", "1.0", "", "a pendulum"), EngineState("absent", None, "pip install 'flexmb[absent]'")]
    monkeypatch.setattr("crosscheck.running.installed.describe_engines", lambda: states)
    output = runner.invoke(cli.app, ["engines"], env=WIDE).output
    assert "not installed" in output
    assert "pip install 'flexmb[absent]'" in output
    assert "a pendulum" in output


def csv_of(path: Path, gravity_factor: float = 1.0, effort: int = 3, drop: str = "") -> Path:
    """What a user's own code might write: the tip's position and the hinge's force."""
    case = load_case(CASE)
    model = Pendulum(case.scene(case.run.variants[0]), gravity_factor)
    times = np.linspace(0.0, 4.0, 81)
    run = model.simulate(Run(times), TOLERANCES[effort])
    columns = {
        "t": times,
        **{f"tip.p{letter}": run.markers["tip"].position[:, i] for i, letter in enumerate("xyz")},
        **{f"pivot.f{letter}": run.loads["pivot"][:, 3 + i] for i, letter in enumerate("xyz")},
    }
    columns.pop(drop, None)
    np.savetxt(path, np.column_stack(list(columns.values())), "%.17g", ",", header=",".join(columns), comments="")
    return path


def verify(runner: CliRunner, *words: str) -> tuple[int, str]:
    result = runner.invoke(cli.app, ["verify", str(CASE), *words, "--engine", "fine"], env=WIDE)
    return result.exit_code, result.output


@pytest.mark.parametrize(
    ("gravity_factor", "change", "code", "said"),
    [
        (1.0, str, 0, "All 2 verdicts are as expected"),
        (1.001, str, 1, "differ, expected agree"),
        (1.0, lambda text: text.replace("tip.", "tap."), 1, "check the name"),
        (1.0, lambda text: text.replace("tip.px", "tip.x", 1), 2, "no whole group contains tip.x"),
        (1.0, lambda text: text.replace("t,", "time,", 1), 2, 'the first column must be "t"'),
        (1.0, lambda text: "\n".join(text.splitlines()[:-3]) + "\n", 2, "do not cover the case's"),
        (1.0, lambda text: "", 2, "cannot be read"),
    ],
)
def test_a_csv_is_judged_or_refused(
    runner: CliRunner, tmp_path: Path, gravity_factor: float, change: Callable[[str], str], code: int, said: str
) -> None:
    file = csv_of(tmp_path / "my.csv", gravity_factor)
    file.write_text(change(file.read_text(encoding="utf-8")), encoding="utf-8")
    ends(runner, ["verify", CASE, file, "--engine", "fine"], code, said)


def test_a_coarse_csv_gives_its_own_uncertainty(runner: CliRunner, tmp_path: Path) -> None:
    """At rtol 1e-6 the results are some 1e-5 off: differing from the claim of the goal, unresolved by their own U."""
    rough, rougher = (
        csv_of(tmp_path / "my.csv", effort=0),
        csv_of(tmp_path / "rough.csv", gravity_factor=1.0001, effort=0),
    )
    assert "differ" in verify(runner, str(rough))[1]
    code, output = verify(runner, str(rough), "--coarse", str(rougher))
    assert (code, "unresolved, expected agree" in output) == (1, True), output


def test_a_template_has_the_times_and_columns(runner: CliRunner, tmp_path: Path) -> None:
    file = tmp_path / "my.csv"
    code, _ = verify(runner, str(file), "--template")
    lines = file.read_text(encoding="utf-8").splitlines()
    assert code == 0
    assert len(lines) == 1 + 81
    assert lines[0].startswith("t,tip.px,tip.py,tip.pz,tip.qw")
    assert verify(runner, str(file))[0] == 2


def test_list_shows_the_shipped_cases(runner: CliRunner, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    copy_case(tmp_path)
    monkeypatch.setattr("crosscheck.library.find.shipped_folder", lambda: tmp_path)
    output = runner.invoke(cli.app, ["list"], env=WIDE).output
    assert "pendulum/single" in output
    assert "fine, stepper" in output


def two_cases(folder: Path, more: str | None = None) -> tuple[Path, Path]:
    """The small case and a copy of it, which compares nothing if `more` stands where its variants and comparisons do.

    What is there by then is one variant of one engine.
    """
    case = copy_case(folder)
    other = case.with_name("other")
    shutil.copytree(case, other)
    if more is not None:
        file = other / "run.toml"
        head = file.read_text(encoding="utf-8").split("[[variant]]")[0]
        file.write_text(f'{head}[[variant]]\nname = "a"\nengines = ["fine"]\n{more}', encoding="utf-8")
    return case, other


def rigid_compared(folder: Path, among: str) -> Path:
    """The small case with `among` in its comparison of the rigid variant."""
    case = copy_case(folder)
    text = (case / "run.toml").read_text(encoding="utf-8")
    assert text.count('variant = "rigid"\ngoals') == 1
    text = text.replace('variant = "rigid"\ngoals', f"{among}\ngoals")
    (case / "run.toml").write_text(text, encoding="utf-8")
    return case


def test_a_run_reports_what_it_was_asked_for_and_report_shows_all(runner: CliRunner, tmp_path: Path) -> None:
    """Two cases into one folder: each run judges its own, the archive holds both."""
    folder, other = two_cases(tmp_path)
    out = tmp_path / "out"
    for case in (folder, other):
        assert runner.invoke(cli.app, ["run", str(case), "--out", str(out)], env=WIDE).exit_code == 0
    assert "pendulum/single" not in (out / "summary.md").read_text(encoding="utf-8")
    index = (out / "report" / "index.html").read_text(encoding="utf-8")
    assert "pendulum/other; engines: all that the cases name" in index
    assert runner.invoke(cli.app, ["report", str(out / "records.jsonl"), "--out", str(out)], env=WIDE).exit_code == 0
    summary = (out / "summary.md").read_text(encoding="utf-8")
    assert "pendulum/single" in summary and "pendulum/other" in summary


def test_two_folders_of_one_name_are_refused(runner: CliRunner, tmp_path: Path) -> None:
    """Only one of them would be run, and the other would be green with it."""
    one, two = copy_case(tmp_path / "a"), copy_case(tmp_path / "b")
    words = ["--out", tmp_path / "out", "--jobs", "2"]
    ends(runner, ["run", one, two, *words], 2, "are both called pendulum/single")
    ends(runner, ["run", one, one, *words], 0, "")


def test_accepting_nothing_is_not_green(runner: CliRunner, tmp_path: Path) -> None:
    """Two cases, one without a part for the engine: all verdicts are as expected, and no figures were written."""
    kept = '\n[[conservation]]\nvariant = "a"\nquantity = "energy"\nlimit = 1e-3\n'
    folder, other = two_cases(tmp_path, kept)
    words = ["--accept", "-e", "stepper", "--out", tmp_path / "out", "--jobs", "2"]
    ends(runner, ["run", folder, other, *words], 1, "nothing was compared in pendulum/other")
    assert not (folder / "accepted.toml").exists()


def test_a_case_in_which_nothing_is_compared_is_named(runner: CliRunner, tmp_path: Path) -> None:
    folder, other = two_cases(tmp_path, "")
    words = ["--out", tmp_path / "out", "--jobs", "2"]
    ends(runner, ["run", folder, other, *words], 0, "pendulum/other: nothing was compared")
    ends(runner, ["run", other, *words], 1, "")


@pytest.mark.parametrize("engines", [["second"], ["fine", "sloppy"]])
def test_an_engine_without_a_part_is_no_request(runner: CliRunner, tmp_path: Path, engines: list[str]) -> None:
    """It takes part neither by name nor, as a foreign one, where engines of a variant are compared; none would tell."""
    pair = 'a = { variant = "rigid", engine = "fine" }\nb = { variant = "rigid", engine = "stepper" }'
    words = [word for name in engines for word in ("-e", name)]
    folder = rigid_compared(tmp_path, pair)
    ends(runner, ["run", folder, *words, "--out", tmp_path / "out"], 2, f"a part for engine {engines[-1]}")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("joining", "code"), [("second", 0), ("sloppy", 1)])
def test_an_engine_that_joins_is_compared_with_those_that_a_case_lists(
    runner: CliRunner, tmp_path: Path, joining: str, code: int
) -> None:
    folder = rigid_compared(tmp_path, 'variant = "rigid"\nengines = ["fine", "stepper"]')
    words = ["-e", "fine", "-e", joining, "--out", str(tmp_path / "out")]
    result = runner.invoke(cli.app, ["run", str(folder), *words], env=WIDE)
    named = f"{joining} –" in result.output or f"– {joining}" in result.output
    assert (result.exit_code, named) == (code, code == 1), result.output


def test_a_template_takes_no_file_s_place(runner: CliRunner, tmp_path: Path) -> None:
    file = csv_of(tmp_path / "my.csv")
    before = file.read_bytes()
    code, output = verify(runner, str(file), "--template")
    assert (code, "exists already" in output, file.read_bytes() == before) == (2, True, True)


def test_a_coarse_csv_has_every_channel(runner: CliRunner, tmp_path: Path) -> None:
    """Without it, the goal would be taken for the uncertainty where a difference was promised."""
    fine, rough = csv_of(tmp_path / "my.csv"), tmp_path / "rough.csv"
    lines = [line.split(",")[:4] for line in fine.read_text(encoding="utf-8").splitlines()]
    rough.write_text("\n".join(map(",".join, lines)) + "\n", encoding="utf-8")
    code, output = verify(runner, str(fine), "--coarse", str(rough))
    assert (code, "lacks load:pivot.force" in output) == (2, True), output


@pytest.mark.parametrize(
    "command", [("regenerate", "pendulums/point_mass"), ("verify", "pendulums/point_mass", "my.csv")]
)
def test_a_scheduler_that_does_not_answer_ends_the_command_before_anything_runs(
    runner: CliRunner, command: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("crosscheck.running.dask_cluster.ANSWER_S", 0.5)
    result = runner.invoke(cli.app, [*command, "--scheduler", "tcp://127.0.0.1:1"])
    assert result.exit_code == 2
    assert "no Dask scheduler answers at tcp://127.0.0.1:1" in " ".join(result.output.split())
