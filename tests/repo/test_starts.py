"""What every start loads: `import flexmb`, words on a command line, a pytest session in which nobody asks for us.

Held by the modules that are loaded, which are the same on every machine, not by a clock: tests/benchmarks has the
times. Each start is a process of its own. Which import brought a module tells `python -X importtime`.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import flexmb as fm
from crosscheck.library.find import shipped_folder
from flexmb.scene import schema
from tests.repo.project import PYPROJECT

DEPENDENCIES = {re.split(r"[^\w-]", each)[0].lower() for each in PYPROJECT["project"]["dependencies"]}
PEERS = {
    "llvmlite", "pinocchio", "mujoco", "exudyn", "pydrake", "dartpy", "Basilisk", "opensim", "KratosMultiphysics",
    "dask", "pandas", "pyarrow",
}  # fmt: skip
LIBRARIES = DEPENDENCIES | PEERS
OF_WORDS = {"typer", "rich"}  # what reads a command line and prints help
OF_CASES = OF_WORDS | {"numpy", "msgspec"}  # what the structs of scenes and cases are made of
# Modules of ours that reading words needs; all of them stand on the standard library, typer and rich.
WORDS = re.compile(
    r"flexmb(\.cli(\.\w+)?|\.output(\.\w+)?|\.scene(\.problems|\.user_code)?|\.integrate(\.integrator)?)?"
    r"|crosscheck(\.cli(\.\w+)?|\.terminal(\.text|\.verbosity)?|\.running(\.schedulers?)?"
    r"|\.conformance(\.limit)?|\.library(\.case_error|\.own_files)?)?"
)
COMPILED = re.compile(r"flexmb\.(jit|tables|spatial|building|jain|frisch|integrate|entry|system|closure|linear)\b.*")

TOLD = """
import json, os, sys
os.write(2, ("loaded " + json.dumps(sorted(sys.modules)) + chr(10)).encode())
"""
COMMAND = """
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from {name}.cli import app, main
printed = StringIO()
def called(*words):
    sys.argv = [{name!r}, *words]
    with redirect_stdout(printed), redirect_stderr(printed):
        try:
            main()
        except SystemExit as end:
            return end.code or 0
"""
EVERY_HELP = """
assert called("--help") == 0
for command in app.registered_commands:
    assert called(command.name or command.callback.__name__, "--help") == 0, command
assert called("a-word-that-is-no-command") == 2
"""
COMMANDS = ("flexmb", "crosscheck")


def loaded(code: str, *words: str, folder: Path | None = None, **variables: str) -> set[str]:
    """Modules at the end of a process that runs some code or, with `words`, python with these."""
    path = os.pathsep.join(os.path.abspath(each) for each in sys.path if each)
    done = subprocess.run(
        [sys.executable, *(words or ("-c", code + TOLD))], cwd=folder, capture_output=True, text=True, timeout=120,
        env=os.environ | {"PYTHONPATH": path} | variables,
    )  # fmt: skip
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("loaded ")] or pytest.fail(
        done.stdout + done.stderr
    )
    return set(json.loads(line.removeprefix("loaded ")))


def libraries(modules: set[str], but: set[str] = frozenset()) -> set[str]:
    """Libraries among the modules, but for those that such a start may load."""
    return ({name.partition(".")[0] for name in modules} & LIBRARIES) - but


def ours(modules: set[str]) -> set[str]:
    return {name for name in modules if name.partition(".")[0] in COMMANDS}


def compiled(modules: set[str]) -> set[str]:
    """Modules of ours that bring the compiler."""
    return {name for name in modules if COMPILED.fullmatch(name)}


def called(command: str, code: str, **variables: str) -> set[str]:
    """Modules after some code that calls a command."""
    return loaded(COMMAND.format(name=command) + code, **variables)


def completed(line: str, found: str) -> set[str]:
    """Modules after a shell has asked how a line may go on, with `found` among the answers."""
    name, last = line.split()[0], len(line.split()) - 1
    asked = {f"_{name.upper()}_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(last)}
    return called(name, f"called()\nassert {found!r} in printed.getvalue().split(), printed.getvalue()", **asked)


def only_words(modules: set[str]) -> bool:
    """Whether no more is loaded than what reads words and prints help."""
    assert not libraries(modules, OF_WORDS)
    assert not {name for name in ours(modules) if not WORDS.fullmatch(name)}
    return modules >= OF_WORDS


def test_import_flexmb_loads_nothing() -> None:
    modules = loaded("import flexmb")
    assert not libraries(modules)
    assert ours(modules) == {"flexmb"}


def test_reading_a_scene_and_checking_its_numbers_compiles_nothing() -> None:
    scene = shipped_folder() / "spacecraft" / "deploy_and_slew" / "scene.toml"
    check = "from flexmb.scene.check import check_scene"
    modules = loaded(f"import flexmb as fm\n{check}\ncheck_scene(fm.load_scene({str(scene)!r}))")
    assert "flexmb.scene.check" in modules
    assert not libraries(modules, {"numpy", "msgspec"})
    assert not compiled(modules)


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_every_command_and_a_mistyped_word_load_what_reads_words(name: str) -> None:
    assert only_words(called(name, EVERY_HELP))


@pytest.mark.parametrize(
    ("line", "found"),
    [("flexmb sim", "simulate"), ("flexmb simulate --a", "--atol"), ("crosscheck stab", "stability"),
     ("crosscheck run --fr", "--fresh")],
)  # fmt: skip
def test_completion_of_commands_and_options_loads_what_reads_words(line: str, found: str) -> None:
    assert only_words(completed(line, found))


@pytest.mark.parametrize(
    ("line", "found"), [("crosscheck run closed", "closed_chains/four_bar"), ("crosscheck run all -e muj", "mujoco")]
)
def test_completion_of_cases_and_engines_loads_neither(line: str, found: str) -> None:
    modules = completed(line, found)
    assert not libraries(modules, OF_CASES) and not compiled(modules)


def test_versions_of_flexmb_are_told_without_loading_what_they_are_of() -> None:
    assert only_words(called("flexmb", 'assert called("--version") == 0'))


def test_the_list_of_cases_reads_cases_and_loads_no_mechanics() -> None:
    modules = called("crosscheck", 'assert called("list") == called("list", "--json") == 0')
    assert "crosscheck.library.find" in modules
    assert not libraries(modules, OF_CASES) and not compiled(modules)


def test_words_that_name_nothing_are_refused_before_what_runs_cases_is_loaded() -> None:
    """Names of engines even before NumPy: little beyond what Python and the reading of words take."""
    named = (
        "run pendulum -e pinochio", "bench all -e pinochio", "chart all -e pinochio", "mutate all -e pinochio",
        "invariance all -e pinochio", "verify pendulum none.csv -e pinochio",
    )  # fmt: skip
    others = ("contract pinochio", "run pendulumm", "regenerate pendulumm", "report none.jsonl")
    refused = "".join(f"assert called(*{line.split()!r}) == 2, printed.getvalue()\n" for line in named)
    refused += "assert not {'numpy', 'msgspec'} & set(sys.modules)\n"
    refused += "".join(f"assert called(*{line.split()!r}) == 2, printed.getvalue()\n" for line in others)
    modules = called("crosscheck", f"{refused}assert 'did you mean \"pinocchio\"?' in printed.getvalue()")
    assert not libraries(modules, OF_CASES | {"psutil"}) and not compiled(modules)
    assert not {name for name in modules if name.startswith(("crosscheck.report", "crosscheck.judging"))}


def test_a_scene_with_defects_is_refused_without_the_compiler(tmp_path: Path) -> None:
    """What sound ones need, as they are compiled and evaluated once."""
    file = tmp_path / "scene.toml"
    file.write_text((shipped_folder() / "pendulums" / "double" / "scene.toml").read_text().replace("ground", "grund"))
    modules = called("flexmb", f'assert called("check", {str(file)!r}) == 2')
    assert not libraries(modules, OF_CASES) and "flexmb.system.compile" not in modules


def test_a_worker_loads_what_its_engine_needs() -> None:
    """A session starts one for every engine: none of them plans, draws or judges, and only our own brings the compiler.

    The parts of scipy that are named here take longer to load than all of ours.
    """
    worker = loaded("import crosscheck.running.execute")
    assert not libraries(worker, {"numpy", "msgspec"}) and not compiled(worker)
    native = loaded("import crosscheck.running.execute, crosscheck.engines.native")
    assert compiled(native) and not {"scipy.interpolate", "scipy.optimize", "scipy.spatial"} & native


def test_a_pytest_session_without_our_options_loads_the_plug_in_alone(tmp_path: Path) -> None:
    """Collected and run to its end, with the hooks of the plug-in called."""
    (tmp_path / "conftest.py").write_text(f"def pytest_unconfigure():\n    exec({TOLD!r})\n", encoding="utf-8")
    (tmp_path / "test_theirs.py").write_text("def test_theirs():\n    pass\n", encoding="utf-8")
    words = ("-m", "pytest", "-q", "-p", "crosscheck.pytest_plugin", "-p", "no:cacheprovider", "test_theirs.py")
    modules = loaded("", *words, folder=tmp_path, PYTEST_DISABLE_PLUGIN_AUTOLOAD="1", PYTEST_ADDOPTS="")
    assert ours(modules) == {"crosscheck", "crosscheck.pytest_plugin"}
    assert not libraries(modules)


def test_a_start_that_loads_mechanics_is_seen() -> None:
    """Or the tests above would hold whatever was loaded."""
    modules = loaded("import flexmb\nflexmb.simulate")
    assert {"numba", "numpy"} <= libraries(modules, OF_WORDS)
    assert compiled(modules)
    assert not all(WORDS.fullmatch(name) for name in ours(modules))


def test_names_of_flexmb_are_there_before_they_are_used() -> None:
    """As attributes, for `dir` and for a star import; those of the schema are the schema's own."""
    code = """
        import flexmb
        assert set(flexmb.__all__) <= set(dir(flexmb))
        scope = {}
        exec("from flexmb import *", scope)
        assert set(flexmb.__all__) <= set(scope)
        """
    loaded(re.sub(r"^ {8}", "", code, flags=re.MULTILINE))
    assert set(schema.__all__) <= set(fm.__all__) and len(set(fm.__all__)) == len(fm.__all__)
    assert all(getattr(fm, name) is getattr(schema, name) for name in schema.__all__)


@pytest.mark.parametrize("name", ["scene.quaternions.rotation_matrix", "scene.schema.Scene", "schema.Scene"])
def test_what_scripts_reach_through_flexmb_is_there_from_the_start(name: str) -> None:
    assert loaded(f"import flexmb\nflexmb.{name}")


def test_a_name_that_is_none_is_refused_by_its_name() -> None:
    with pytest.raises(AttributeError, match="'flexmb' has no attribute 'simulat'"):
        fm.simulat  # noqa: B018
