"""Names that users give to commands are looked up before any work: one error, one suggestion, exit code 2."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from typer.core import TyperGroup
from typer.main import get_command
from typer.testing import CliRunner

import flexmb.cli
from crosscheck import cli
from crosscheck.library.find import shipped_folder
from flexmb.scene.problems import LISTED, closest

resource = pytest.importorskip("resource", reason="only Unix tells the processor time of other processes")

CASE = "pendulums/compound"
SCENE = str(shipped_folder() / "beams" / "cantilever" / "scene.toml")
SWEEP = """
title = "sweep"
scene = {scene!r}
duration_s = 1.0
samples = 11
engines = ["{engine}"]
sampling = "grid"
parameter = [{{ path = "bodies.beam.length_m", distribution = "values", values = [1.0] }}]
quantity = [{{ name = "tip", channel = "{channel}", value = "final", component = "z" }}]
"""
PINOCCHIO, NATIVE = 'did you mean "pinocchio"?', 'did you mean "native"?'
UNKNOWN: dict[tuple[str, ...], tuple[str, str]] = {
    ("run", "CASE"): ("pendulums/compund", 'did you mean "pendulums/compound"?'),
    ("run", "CASE", "-e"): ("pinochio", PINOCCHIO),
    ("run", "CASE", "--goal"): ("pinochio:marker=0.1", PINOCCHIO),
    ("run", "CASE", "--efforts"): ("pinochio=1e-3", PINOCCHIO),
    ("bench", "CASE"): ("compund", 'did you mean "compound"?'),
    ("bench", "CASE", "-e"): ("pinochio", PINOCCHIO),
    ("bench", "CASE", "--variant"): ("rgid", "did you mean"),
    ("chart", "CASE"): ("compund", 'did you mean "compound"?'),
    ("chart", "CASE", "-e"): ("natve", NATIVE),
    ("chart", "CASE", "--variant"): ("rgid", "did you mean"),
    ("verify", "CASE", "none.csv", "--engine"): ("natve", NATIVE),
    ("verify", "CASE", "none.csv", "--variant"): ("rgid", "did you mean"),
    ("regenerate", "CASE"): ("compund", 'did you mean "compound"?'),
    ("export", "CASE"): ("compund", 'did you mean "compound"?'),
    ("contract", "ENGINE"): ("natve", NATIVE),
    ("contract", "native", "--clause"): ("a-pendlum-swings", 'did you mean "a-pendulum-swings"?'),
    ("mutate", "CASE", "-e"): ("natve", NATIVE),
    ("invariance", "CASE", "-e"): ("natve", NATIVE),
    ("stability", "MAP"): ("vibrating_hinje", 'did you mean "vibrating_hinge"?'),
    ("sensitivity", "CASE"): ("compund", 'did you mean "compound"?'),
    ("label", "CASE"): ("compund", 'did you mean "compound"?'),
    ("validate", "SET"): ("yoyo_dispin", 'did you mean "yoyo_despin"?'),
}
"""For every way to name an engine, a case, a variant or a map: a word that is none, and what is suggested."""
WITHOUT_NAMES = {"report", "compare", "list", "engines", "sweep", "manufacture"}
"""Commands that take files alone; names in the file of a sweep have a test of their own."""


def asked(words: tuple[str, ...], name: str, folder: Path) -> tuple[int, str]:
    """The exit code and what is said where the last word is `name`."""
    taken = words[:-1] + (name,) if words[-1].isupper() else (*words, name)
    command = [CASE if word == "CASE" else word for word in taken]
    if words[0] in ("run", "chart", "export", "mutate", "invariance", "stability"):
        command += ["--out", str(folder / "out")]
    found = CliRunner().invoke(cli.app, command, env={"COLUMNS": "300"})
    return found.exit_code, found.output


@pytest.mark.parametrize("words", UNKNOWN, ids=" ".join)
def test_a_name_that_there_is_not_is_refused_with_the_nearest(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    no_work(monkeypatch)
    name, suggestion = UNKNOWN[words]
    code, output = asked(words, name, tmp_path)
    assert (code, output.count(name), suggestion in output) == (2, 1, True) or (
        words[-1] in ("--goal", "--efforts") and code == 2 and suggestion in output
    ), output
    assert len(output.strip().splitlines()) <= 2 and len(output) < 400, output
    assert list(tmp_path.glob("*")) in ([], [tmp_path / "out"]) and not any(tmp_path.glob("out/*.jsonl"))


def no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever begins to run anything fails."""

    def begun(*_: object, **__: object) -> None:
        raise AssertionError("work has begun")

    for place in ("running.sweep.sweep", "running.sweep.run_planned", "timing.bench.bench", "timing.chart.chart",
                  "mutation.campaign.run_campaign", "mutation.invariance_runs.run_invariances",
                  "conformance.trial.try_engine", "terminal.many_runs.run_and_draw"):  # fmt: skip
        monkeypatch.setattr(f"crosscheck.{place}", begun)


def test_every_command_that_takes_names_is_tried() -> None:
    """Options are found by the words of their help or names, so that a new command or option is missed by none."""
    group = get_command(cli.app)
    assert isinstance(group, TyperGroup)
    tried = {words[0] for words in UNKNOWN}
    assert set(group.commands) == tried | WITHOUT_NAMES
    for name, command in group.commands.items():
        options = {option for parameter in command.params for option in parameter.opts}
        for option in {"--engine", "--variant", "--goal", "--efforts", "--clause"} & options:
            short = "-e" if option == "--engine" and name != "verify" else option
            assert any(words[0] == name and words[-1] == short for words in UNKNOWN), (name, option)


@pytest.mark.parametrize("engine", ["drake", "mujoco"])
@pytest.mark.parametrize(
    "words",
    [("run", CASE, "-e"), ("bench", CASE, "-e"), ("chart", CASE, "-e"), ("verify", CASE, "none.csv", "--engine"),
     ("mutate", CASE, "-e"), ("invariance", CASE, "-e"), ("contract",)],
    ids=" ".join,
)  # fmt: skip
def test_an_engine_that_is_asked_for_and_not_installed_is_refused(
    words: tuple[str, ...], engine: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    no_work(monkeypatch)
    monkeypatch.setitem(__import__("sys").modules, {"drake": "pydrake"}.get(engine, engine), None)
    found = CliRunner().invoke(cli.app, [*words, engine], env={"COLUMNS": "300"})
    assert found.exit_code == 2, found.output
    assert f"engine {engine} is not installed: " in found.output
    assert f"pip install {engine}" in found.output and len(found.output.strip().splitlines()) == 1


@pytest.mark.parametrize(
    "change, suggestion",
    [({"engine": "natve"}, NATIVE), ({"channel": "marker:tipp.position"}, 'did you mean "tip"?')],
)
def test_names_in_a_sweep_are_looked_up_first(change: dict[str, str], suggestion: str, tmp_path: Path) -> None:
    names = {"scene": SCENE, "engine": "native", "channel": "marker:tip.position"} | change
    file = tmp_path / "sweep.toml"
    file.write_text(SWEEP.format(**names), encoding="utf-8")
    found = CliRunner().invoke(cli.app, ["sweep", str(file), "--out", str(tmp_path / "out")], env={"COLUMNS": "300"})
    assert (found.exit_code, suggestion in found.output) == (2, True), found.output


@pytest.mark.parametrize(
    "words, suggestion",
    [
        (("mass", SCENE, "--body", "beem"), 'did you mean "beam"?'),
        (("simulate", SCENE, "--t-end", "1", "--sections", "beem"), 'did you mean "beam"?'),
        (("simulate", SCENE, "--t-end", "1", "--set", "beem.length_m=1.0"), 'did you mean "beam"?'),
        (("simulate", SCENE, "--t-end", "1", "--method", "dop85"), "use one of 'dop853'"),
        (("advise", SCENE, "--quantity", "marker:tipp.position"), 'did you mean "marker:tip.position"?'),
        (("linearize", SCENE, "--spin", "pivot", "--rate", "1"), "does not spin about one axis"),
        (("campbell", SCENE, "pivot", "--rates", "0:1:2"), "does not spin about one axis"),
        (("vibrate", SCENE, "--density", "1:1,2:1", "--output", "tipp.*"), "fits none of"),
        (("export", SCENE, "beem", "--out", "b.sid"), 'did you mean "beam"?'),
        (("equivalence", SCENE, "beem", "--axis", "y"), 'did you mean "beam"?'),
        (("warmup", SCENE, "--method", "dop85"), "use one of 'dop853'"),
        (("warmup", SCENE, "--all"), "for every scene, method and algorithm: name none beside it"),
    ],
    ids=lambda each: each[0] if isinstance(each, tuple) else "",
)
def test_names_in_a_scene_are_refused_with_the_nearest(
    words: tuple[str, ...], suggestion: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    found = CliRunner().invoke(flexmb.cli.app, list(words), env={"COLUMNS": "300"})
    assert (found.exit_code, suggestion in found.output) == (2, True), found.output
    assert len(found.output.strip().splitlines()) == 1 and list(tmp_path.glob("*")) == []


def test_long_lists_of_names_are_no_suggestion() -> None:
    many = [f"case_{n}" for n in range(LISTED + 1)]
    assert closest("nowhere", many[:3]) == "use one of: case_0, case_1, case_2"
    told = f'none of the {len(many)} that there are is near; the nearest is "case_\\d+"'
    assert re.fullmatch(told, closest("zz", many))


def cpu_seconds(*words: str) -> tuple[float, int, str]:
    """Processor time (s) of a command in a process of its own, which other processes do not lengthen; its exit code and
    what it says on stderr."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, "-m", "crosscheck", *words], capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return spent, done.returncode, done.stderr


def test_a_refused_request_takes_little_longer_than_help(tmp_path: Path) -> None:
    """Nothing is planned, compiled or run before names are looked up: a second of an idle core, three of a busy one."""
    helping, code, _ = cpu_seconds("--help")
    assert code == 0
    for words in (("run", "all", "-e", "pinochio"), ("run", "pendulums/compund"), ("contract", "natve")):
        taken, code, said = cpu_seconds(*words, *(("--out", str(tmp_path / "out")) if words[0] == "run" else ()))
        assert (code, len(said.strip().splitlines())) == (2, 1), said
        assert taken <= helping + 3.0, f"{' '.join(words)}: {taken:.2f} s, and help {helping:.2f} s"
    assert list(tmp_path.glob("*")) == []
