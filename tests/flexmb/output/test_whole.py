"""Files appear whole or not at all: errors, full disks and kills while writing leave what was there before."""

from __future__ import annotations

import ast
import os
import resource
import signal
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import crosscheck
import flexmb
from flexmb.output.files import clear_parts, take_away, whole_file, write_whole
from tests.repo.project import ROOT

# Calls that write a file under the name that they are given.
WRITERS = {"write_text", "write_bytes", "savefig", "savez", "savez_compressed", "savetxt", "savemat", "write_table"}
# Who writes for a reason of its own, and why that may be torn.
APART = {
    "flexmb/output/files.py": "it is the way",
    "flexmb/jit/cache.py": "writes beside and replaces, each file with its digest",
    "crosscheck/records/archive.py": "appends lines, a torn one is cut off; what it rewrites is whole",
    "crosscheck/records/lock.py": "who holds a lock: of use to nobody after a kill",
    "crosscheck/running/worker.py": "appends to a log",
    "crosscheck/sampling/outputs.py": "the table that grows says in its name that it is unfinished",
    "crosscheck/library/reference.py": "writes into a text in memory",
}


def content(folder: Path) -> dict[str, str]:
    return {each.name: each.read_text("utf-8") for each in folder.iterdir()}


def test_an_error_while_writing_leaves_what_was_there(tmp_path: Path) -> None:
    write_whole(tmp_path / "a.txt", "before")
    with pytest.raises(RuntimeError), whole_file(tmp_path / "a.txt") as beside:
        beside.write_text("half", encoding="utf-8")
        raise RuntimeError
    assert content(tmp_path) == {"a.txt": "before"}


def test_a_full_disk_leaves_what_was_there_and_the_error_names_the_file(tmp_path: Path) -> None:
    """Held to 1000 bytes a file, as by a quota."""
    write_whole(tmp_path / "a.txt", "before")
    code = (
        "from pathlib import Path; from flexmb.output.files import write_whole\n"
        "try: write_whole(Path('a.txt'), 'x' * 100000)\n"
        "except OSError as error: print(error.filename, error.strerror)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}, text=True,
        capture_output=True, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000)),
    )  # fmt: skip
    assert done.stdout.startswith("a.txt File too large: it was not written; free some space"), done
    assert content(tmp_path) == {"a.txt": "before"}


def test_a_kill_while_writing_leaves_what_was_there(tmp_path: Path) -> None:
    """And a part of a file by a name of its own, which the next session clears away."""
    write_whole(tmp_path / "a.txt", "before")
    code = (
        "import os, signal; from pathlib import Path; from flexmb.output.files import whole_file\n"
        "with whole_file(Path('a.txt')) as beside:\n"
        "    beside.write_text('half')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)})
    assert done.returncode == -signal.SIGKILL
    assert (tmp_path / "a.txt").read_text("utf-8") == "before" and len(content(tmp_path)) == 2
    clear_parts(tmp_path)
    assert content(tmp_path) == {"a.txt": "before"}


def test_what_is_there_keeps_its_permissions_and_links_are_followed(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("before", encoding="utf-8")
    (tmp_path / "a.txt").chmod(0o640)
    (tmp_path / "link").symlink_to("a.txt")
    write_whole(tmp_path / "link", "after")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "a.txt").read_text("utf-8") == "after"
    assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == 0o640


def test_what_is_no_file_is_written_to_as_it_is(tmp_path: Path) -> None:
    write_whole(Path(os.devnull), "gone")
    assert not Path(os.devnull).is_file()
    take_away(Path(os.devnull))
    code = "from flexmb.output.files import *; write_whole(Path('/dev/stdout'), 'x')"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout == "x"
    with pytest.raises(IsADirectoryError, match=str(tmp_path)):
        write_whole(tmp_path, "no")


def test_an_error_of_the_disk_names_the_file_that_was_asked_for(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError) as error:
        write_whole(tmp_path / "no" / "a.txt", "no")
    assert error.value.filename == str(tmp_path / "no" / "a.txt")


def test_every_file_of_both_packages_is_written_whole() -> None:
    """A call that writes under the name it is given stands in a `with whole_file(...)`."""
    packages = [Path(str(package.__file__)).parent for package in (flexmb, crosscheck)]
    files = [(folder.parent, file) for folder in packages for file in folder.rglob("*.py")]
    torn = {
        f"{name}:{line}"
        for above, file in files
        if (name := file.relative_to(above).as_posix()) not in APART
        for line in torn_writes(file.read_text(encoding="utf-8"))
    }
    assert len(files) > 300 and not torn


@pytest.mark.parametrize(
    ("text", "torn"),
    [
        ("path.write_text('x')", 1),
        ("open(path, 'w')", 1),
        ("path.open(mode='xb')", 1),
        ("figure.savefig(path)", 1),
        ("path.open()", 0),
        ("with whole_file(path) as beside:\n    beside.write_text('x')", 0),
        ("with whole_file(path) as beside, beside.open('w') as file:\n    file.write('x')", 0),
        ("with other(path):\n    np.savez(path)", 1),
    ],
)
def test_the_search_finds_what_it_is_for(text: str, torn: int) -> None:
    assert len(list(torn_writes(text))) == torn


def torn_writes(text: str) -> Iterator[int]:
    """Lines of calls that write a file under its own name."""

    def visit(node: ast.AST, whole: bool) -> Iterator[int]:
        if isinstance(node, ast.With | ast.AsyncWith):
            whole = whole or any("whole_file(" in ast.unparse(item.context_expr) for item in node.items)
        if isinstance(node, ast.Call) and not whole and writes(node) and "whole_file(" not in ast.unparse(node):
            yield node.lineno
        for child in ast.iter_child_nodes(node):
            yield from visit(child, whole)

    return visit(ast.parse(text), False)


def writes(call: ast.Call) -> bool:
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if name != "open":
        return name in WRITERS
    given = [*call.args, *(word.value for word in call.keywords if word.arg == "mode")]
    return any(isinstance(each, ast.Constant) and str(each.value).strip("bt+") in ("w", "x", "a") for each in given)
