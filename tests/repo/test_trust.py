"""What SECURITY.md says of code in files of others: every place that runs such code is one that the page speaks of."""

import ast
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.main import get_command
from typer.testing import CliRunner

import crosscheck.cli
import flexmb.cli
from flexmb.scene.user_code import VARIABLE
from tests.repo.project import ROOT

RUNS_CODE = {"exec", "eval", "exec_module", "import_module", "__import__", "run_path", "run_module", "entry_points"}
UNPICKLES = {"pickle", "cloudpickle", "marshal", "shelve", "joblib"}
STARTS = {"subprocess", "runpy", "urllib.request", "http", "socket", "requests"}

PLACES = {
    "flexmb/__init__.py": "names of flexmb itself", "flexmb/control/user.py": "laws that a scene names",
    "flexmb/export/emitted.py": "kernels of flexmb, to take their code out",
    "flexmb/export/web.py": "the compiler ziglang, for the same text",
    "flexmb/export/writing.py": "the C compiler, for text of flexmb's own in which names of a scene are escaped",
    "flexmb/jit/direct.py": "text of flexmb's own",
    "flexmb/jit/linking.py": "modules of flexmb and of what it compiles with",
    "flexmb/jit/numbered.py": "text of flexmb's own", "flexmb/jit/stored.py": "compiled kernels",
    "flexmb/run/beside.py": "flexmb's own warming up, for a scene without laws of users",
    "crosscheck/engines/peer.py": "the library that an adapter declares",
    "crosscheck/engines/registry.py": "built-in engines, plug-ins, and what a caller in Python names, never a file",
    "crosscheck/library/code.py": "files beside a case, by crosscheck regenerate, model.py, by validate, own maps",
    "crosscheck/stability/catalogue.py": "maps of crosscheck's own",
    "crosscheck/stability/run.py": "what gives the maps: named by a caller in Python, never by a file",
}  # fmt: skip
"""Every file of the packages that runs code by its name or unpickles it; and whose code that is."""


def suspicious(source: str) -> Iterator[str]:
    """Calls that run code by its name, and imports of what unpickles, starts processes or reaches the network."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if called in RUNS_CODE:
                yield called
        modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom):
            modules += [f"{node.module}.{alias.name}" for alias in node.names]
        dotted = UNPICKLES | STARTS
        yield from (module for module in modules if any(f"{module}.".startswith(f"{name}.") for name in dotted))


def test_code_is_run_where_the_page_says_and_nowhere_else() -> None:
    files = [file for package in ("flexmb", "crosscheck") for file in sorted((ROOT / package).rglob("*.py"))]
    found = {str(file.relative_to(ROOT)) for file in files if [*suspicious(file.read_text(encoding="utf-8"))]}
    assert found == set(PLACES), "say in SECURITY.md whose code it is, and here"


@pytest.mark.parametrize(
    "line",
    [
        "exec(text)",
        "import pickle",
        "from subprocess import run",
        "from urllib import request",
        "spec.loader.exec_module(m)",
    ],
)
def test_a_new_place_is_found(line: str) -> None:
    assert [*suspicious(line)]
    assert not [*suspicious("import numpy\nregex.compile('x')")]


TAKE_NO_SCENES = {"report", "compare", "list", "engines", "contract", "reduce", "schema", "import"}


def test_every_command_that_takes_scenes_or_cases_can_forbid_their_code() -> None:
    commands = {
        name: {option for parameter in command.params for option in parameter.opts}
        for module in (crosscheck.cli, flexmb.cli)
        for name, command in get_command(module.app).commands.items()  # type: ignore[attr-defined]
    }
    assert {name for name, options in commands.items() if "--no-user-code" not in options} == TAKE_NO_SCENES


def test_the_closed_form_of_a_case_is_not_run_where_user_code_is_forbidden(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, "0")  # the option sets it, for what the process starts
    case = shutil.copytree(ROOT / "cases" / "tops" / "free_body", tmp_path / "mine" / "body")
    (case / "exact.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\n", encoding="utf-8")
    done = CliRunner().invoke(crosscheck.cli.app, ["regenerate", "--no-user-code", str(case)])
    assert done.exit_code == 1 and "user code was forbidden" in " ".join(done.output.split()), done.output
    assert not (tmp_path / "ran").exists()


def test_the_closed_form_of_a_case_lies_in_its_folder(tmp_path: Path) -> None:
    """So that who has read the folder has read all that it runs."""
    case = shutil.copytree(ROOT / "cases" / "tops" / "free_body", tmp_path / "mine" / "body")
    text = (case / "run.toml").read_text(encoding="utf-8")
    (case / "run.toml").write_text(text.replace('"exact.py"', '"../exact.py"'), encoding="utf-8")
    done = CliRunner().invoke(crosscheck.cli.app, ["regenerate", str(case)])
    assert done.exit_code == 2 and "lies in the case's folder" in " ".join(done.output.split()), done.output
