"""A checkout's installation compiles what README's examples and the canonical cases need, and tells of it."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from time import sleep
from types import SimpleNamespace

import pytest

import flexmb
from flexmb.jit import installed
from flexmb.jit.installed import MADE_BY, described, is_whole
from flexmb.ready import make
from flexmb.ready.uses import FIRST, uses
from tests.repo.project import ROOT
from tests.repo.snippets import snippets

whole = pytest.mark.skipif(not is_whole(), reason="not all general kernels came with the installation")
BLOCKS = [block.code for block in snippets(ROOT / "README.md") if block.language == "python" and not block.why]
README = "\n".join(BLOCKS[:4])  # a scene, its run, linear models, Jacobians: they read no file


def test_first_uses_come_first() -> None:
    names = [name for name, _ in uses()]
    assert names[: len(FIRST)] == list(FIRST) and len(names) > len(FIRST)


@pytest.mark.parametrize(
    ("version", "asked", "first"),
    [("editable", None, True), ("standard", None, False), ("editable", "all", False), ("standard", "first", True)],
)
def test_a_checkout_gets_the_first_and_a_wheel_all(monkeypatch, version: str, asked: str | None, first: bool) -> None:
    assert ("--first" in command_of(monkeypatch, version, asked)) == first


def test_a_choice_that_is_none_is_refused(monkeypatch) -> None:
    assert command_of(monkeypatch, "editable", "no") == []
    with pytest.raises(ValueError, match="use one of first, all, no"):
        command_of(monkeypatch, "editable", "none")


def command_of(monkeypatch, version: str, asked: str | None) -> list[str]:
    """What the build hook starts."""
    if asked is None:
        monkeypatch.delenv("FLEXMB_BUILD_KERNELS", raising=False)
    else:
        monkeypatch.setenv("FLEXMB_BUILD_KERNELS", asked)
    spec = importlib.util.spec_from_file_location("build_kernels", ROOT / "build_kernels.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    commands: list[list[str]] = []
    monkeypatch.setattr(
        module.subprocess, "run", lambda command, **_: commands.append(command) or SimpleNamespace(returncode=0)
    )
    hook = SimpleNamespace(root=str(ROOT))
    module.KernelHook.initialize(hook, version, {"artifacts": []})
    return commands[0] if commands else []


def test_a_folder_that_says_nothing_of_it_is_not_whole(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(installed, "installed_directory", lambda: tmp_path)
    monkeypatch.setattr(installed, "unfit", lambda: "")
    for said in ("", "[]", "{}", json.dumps({"whole": False})):
        (tmp_path / MADE_BY).write_text(said)
        is_whole.cache_clear()
        assert not is_whole()
    (tmp_path / MADE_BY).write_text(json.dumps({"whole": True}))
    is_whole.cache_clear()
    assert is_whole()
    is_whole.cache_clear()


def test_silence_is_broken_by_how_far_it_is(tmp_path: Path, monkeypatch, capsys) -> None:
    """And a use that fails, or whose process dies, says why and is refused by its name."""

    def use(name: str) -> make.Used:
        sleep(0.1)
        (tmp_path / f"{name}-00.kernel").touch()
        sleep(0.1)
        if name == "three":
            raise BrokenProcessPool("a process died")
        return make.Used(name, 7.0, "" if name == "one" else "\nwhy", {})

    monkeypatch.setattr(make, "_use", use)
    monkeypatch.setattr(make, "SILENCE", 0.15)
    monkeypatch.setattr(make, "ProcessPoolExecutor", lambda processes, context, begin: ThreadPoolExecutor(1))
    (tmp_path / "old-00.kernel").touch()
    used = make._run(["one", "two", "three"], 1, tmp_path)
    lines = capsys.readouterr().err.splitlines()
    told = [line for line in lines if "compiling" not in line]
    assert [line[:8] for line in told] == ["  1 of 3", "  2 of 3", "why", "  3 of 3", "a proces"]
    assert "  0 of 3  compiling, 1 kernels after 0 s" in lines
    with pytest.raises(RuntimeError, match="whose kernels may be missing: two; three$"):
        make._refuse_failures(used)


def test_what_has_not_changed_is_not_made_again(tmp_path: Path, monkeypatch, capsys) -> None:
    """As where a wheel is built of a checkout that is installed. What could make another kernel is a change."""
    package, folder, compiled = tmp_path / "flexmb", tmp_path / "kernels", list[list[str]]()
    (package / "ready").mkdir(parents=True)
    (package / "code.py").write_text("one")

    def run(names: list[str], processes: int, made: Path) -> list[make.Used]:
        compiled.append(names)
        (made / "a-00.kernel").write_text("machine code")
        return [make.Used("one", 1.0, trouble, {"a": 2.0})]

    def changes(first: bool = False) -> bool:
        count = len(compiled)
        found = make.make(folder, 1, first=first)
        assert [file.name for file in found] == ["a-00.kernel"]
        assert ("has changed since" in capsys.readouterr().err) == (len(compiled) == count)
        return len(compiled) > count

    maker, trouble = {"versions": {"numba": "1"}, "processor": ["x"]}, ""
    monkeypatch.setattr(make, "__file__", str(package / "ready" / "make.py"))
    monkeypatch.setattr(make, "_run", run)
    monkeypatch.setattr(make, "_maker", lambda processor: maker)
    monkeypatch.setattr(make, "_names", lambda first: ["first"] if first else ["first", "other"])
    assert changes(first=True) and not changes(first=True)
    assert changes() and not changes() and not changes(first=True)  # a folder that once had all
    assert compiled == [["first"], ["first", "other"]]
    (package / "code.py").write_text("two")
    assert changes() and not changes()
    (package / "more.py").touch()
    assert changes() and not changes()
    (folder / "a-00.kernel").write_text("damaged code")
    assert changes() and not changes()
    (folder / "b-00.kernel").touch()
    assert changes() and not changes()
    maker = {"versions": {"numba": "2"}, "processor": ["x"]}
    assert changes() and not changes()
    (package / "code.py").write_text("three")
    trouble = "why"
    with pytest.raises(RuntimeError, match="missing: one"):
        changes()
    trouble = ""
    assert changes() and not changes()


@whole
@pytest.mark.slow
def test_readme_and_canonical_need_nothing_beyond(tmp_path: Path) -> None:
    """On a copy of this installation that has lost what the first uses do not load."""
    package, out = tmp_path / "flexmb", tmp_path / "out"
    shutil.copytree(Path(flexmb.__file__).parent, package)
    folder = package / "ready" / "kernels"
    (folder / MADE_BY).write_text(json.dumps(described(folder) | {"whole": False, "kernels": "others"}))
    path = os.pathsep.join((str(tmp_path), str(ROOT)))
    environment = os.environ | {"PYTHONPATH": path, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    del environment["FLEXMB_KERNELS"]
    for words in (
        ["-m", "flexmb.ready.make", str(folder), "--first"],
        ["-c", README],
        ["-m", "crosscheck", "run", "canonical", "--out", str(out)],
    ):
        subprocess.run([sys.executable, *words], cwd=tmp_path, env=environment, check=True)
    assert sorted(file.name for file in (tmp_path / "cache").rglob(make.KERNELS)) == []
