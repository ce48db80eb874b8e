"""However flexmb came onto the path, the same scene gives the same numbers from the same compiled kernels.

Each way is a process of its own, which says where its motion ended, which files of compiled kernels it asked for and
what loaded its modules. Files are asked for by the digest of the code that they depend on, so equal names mean that a
reader of a zip file, of bytecode without sources or pytest, which rewrites what it imports, has changed nothing.
"""

import compileall
import json
import shutil
import zipfile
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any

import pytest

from crosscheck.library import own_files
from crosscheck.library.case import CaseError
from crosscheck.library.find import shipped_folder
from crosscheck.library.own_files import code_here
from crosscheck.records.sources import sources
from tests.repo.installations import called, fresh_environment, packages_of, said
from tests.repo.project import ROOT

# As a user's test; run as a program it does the same, so that both can be compared. Kernels are there already, those of
# this checkout: the wheel of these tests was built without, and to compile them would take half a minute.
USER = """
import json
import pathlib
import sys

import flexmb as fm
from flexmb.jit import cache
from flexmb.jit.cache import KernelCache

cache.installed_directory = lambda: pathlib.Path(READY)


def test_user():
    asked, named = set(), KernelCache._own

    def noted(cache, *words):
        asked.add(named(cache, *words).name)
        return named(cache, *words)

    KernelCache._own = noted
    body = {"mass": 1.0, "com": (0.5, 0, 0), "inertia": (0.1, 0.1, 0.1)}
    scene = fm.SceneBuilder("a user's", gravity=(0, 0, -9.81)).rigid_body("rod", **body)
    scene = scene.revolute("pivot", "ground", "rod", axis=(0, 1, 0)).scene()
    run = fm.simulate(fm.compile(scene, kernels="general"), t_end=0.1)
    ours = {name: module for name, module in sys.modules.items() if name.partition(".")[0] in ("flexmb", "crosscheck")}
    told = {
        "place": getattr(fm, "__file__", ""),
        "end": run.q[-1].tolist(),
        "asked": sorted(asked),
        "loaders": {name: type(module.__spec__.loader).__name__ for name, module in ours.items()},
    }
    sys.__stdout__.write("told " + json.dumps(told) + chr(10))


if __name__ == "__main__":
    test_user()
""".replace("READY", repr(str(ROOT / "flexmb" / "ready" / "kernels")))
PYTEST = ("python", "-m", "pytest", "-q", "-s", "test_user.py")
# As the loaders of frozen programs: code objects from an archive, found by a hook on the path, with neither files nor
# sources; what a package contains is listed by the hook's finder.
FROZEN = """
import importlib.abc, importlib.util, marshal, pathlib, sys, zipfile

archive = zipfile.ZipFile(sys.argv[1])
files = {name.removesuffix(".pyc").removesuffix("/__init__").replace("/", "."): name for name in archive.namelist()}
packages = {module for module, name in files.items() if name.endswith("/__init__.pyc")}


class Loader(importlib.abc.InspectLoader):
    def get_source(self, name):
        return None

    def is_package(self, name):
        return name in packages

    def get_code(self, name):
        return marshal.loads(archive.read(files[name])[16:])


class Finder:
    def __init__(self, place):
        if not place.startswith("frozen:"):
            raise ImportError
        self.package = place.removeprefix("frozen:")

    def find_spec(self, name, target=None):
        if name not in files:
            return None
        spec = importlib.util.spec_from_loader(name, Loader())
        if name in packages:
            spec.submodule_search_locations = ["frozen:" + name]
        return spec

    def iter_modules(self, prefix=""):
        inside = {name for name in files if name.rpartition(".")[0] == self.package}
        return [(prefix + name.rpartition(".")[2], name in packages) for name in inside]


sys.path_hooks.insert(0, Finder)
sys.path.insert(0, "frozen:")
exec(compile(pathlib.Path(sys.argv[2]).read_text(), "user", "exec"))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An otherwise empty one, with the user's test."""
    made = tmp_path_factory.mktemp("user")
    (made / "test_user.py").write_text(USER, encoding="utf-8")
    return made


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Commands of an environment without flexmb."""
    return fresh_environment(tmp_path_factory.mktemp("bare"))


@pytest.fixture(scope="module")
def without_sources(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Bytecode alone, as for a program that hides its sources."""
    place = tmp_path_factory.mktemp("bytecode")
    for package in ("flexmb", "crosscheck"):
        shutil.copytree(wheel / package, place / package, ignore=shutil.ignore_patterns("cases", "__pycache__"))
    assert compileall.compile_dir(place, legacy=True, quiet=2)
    for source in place.rglob("*.py"):
        source.unlink()
    return place


@pytest.fixture(scope="module")
def frozen(without_sources: Path, folder: Path) -> Path:
    """An archive of bytecode, and beside it the program whose loaders read it."""
    archive = folder / "frozen.archive"
    with zipfile.ZipFile(archive, "w") as packed:
        for file in without_sources.rglob("*.pyc"):
            packed.write(file, file.relative_to(without_sources))
    (folder / "frozen.py").write_text(FROZEN, encoding="utf-8")
    return archive


@pytest.fixture(scope="module")
def linked(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Commands of an environment with an egg link, as `setup.py develop` left it."""
    sources, home = tmp_path_factory.mktemp("sources"), tmp_path_factory.mktemp("linked")
    for package in ("flexmb", "crosscheck"):
        shutil.copytree(wheel / package, sources / package, ignore=shutil.ignore_patterns("cases", "__pycache__"))
    (metadata,) = wheel.glob("*.dist-info")
    egg = sources / "flexmb.egg-info"
    egg.mkdir()
    shutil.copy(metadata / "METADATA", egg / "PKG-INFO")
    shutil.copy(metadata / "entry_points.txt", egg)
    files = [file.relative_to(sources).as_posix() for file in sources.rglob("*.py")]
    (egg / "SOURCES.txt").write_text("\n".join(files), encoding="utf-8")
    commands = fresh_environment(home)
    (packages_of(home) / "flexmb.egg-link").write_text(f"{sources}\n.", encoding="utf-8")
    (packages_of(home) / "easy-install.pth").write_text(f"{sources}\n", encoding="utf-8")
    return commands


def told(output: str) -> dict[str, Any]:
    (line,) = [line for line in output.splitlines() if line.startswith("told ")]
    return json.loads(line.removeprefix("told "))


@pytest.fixture(scope="module")
def ordinary(installed: Path, folder: Path) -> dict[str, Any]:
    """From the wheel, installed, in a program."""
    found = told(said(installed, folder, "python", "test_user.py"))
    assert found["asked"] and set(found["loaders"].values()) == {"SourceFileLoader"}
    return found


def same(found: dict[str, Any], ordinary: dict[str, Any]) -> bool:
    return (found["end"], found["asked"]) == (ordinary["end"], ordinary["asked"])


def test_inside_pytest(installed: Path, folder: Path, ordinary: dict[str, Any]) -> None:
    """pytest's rewriting is off for both packages, but for the two modules that pytest itself asks for."""
    found = told(said(installed, folder, *PYTEST))
    assert same(found, ordinary)
    rewritten = {name for name, loader in found["loaders"].items() if loader != "SourceFileLoader"}
    assert rewritten == {"crosscheck", "crosscheck.pytest_plugin"}


def test_inside_pytest_without_the_plug_in(installed: Path, folder: Path, ordinary: dict[str, Any]) -> None:
    """Who forbids the plug-in gets rewritten modules, and from these the same kernels."""
    found = told(said(installed, folder, *PYTEST, "-p", "no:crosscheck.pytest_plugin"))
    assert same(found, ordinary)
    assert found["loaders"]["flexmb"] == "AssertionRewritingHook"


def test_inside_pytest_by_an_egg_link(linked: Path, folder: Path, ordinary: dict[str, Any]) -> None:
    found = told(said(linked, folder, *PYTEST))
    assert same(found, ordinary)
    assert found["place"] != ordinary["place"]
    assert found["loaders"]["flexmb"] == "SourceFileLoader"


def test_from_a_zip_file(bare: Path, folder: Path, archive: Path, ordinary: dict[str, Any]) -> None:
    found = told(said(bare, folder, "python", "test_user.py", path=archive))
    assert same(found, ordinary)
    assert set(found["loaders"].values()) == {"zipimporter"}


def test_from_bytecode(bare: Path, folder: Path, without_sources: Path, ordinary: dict[str, Any]) -> None:
    found = told(said(bare, folder, "python", "test_user.py", path=without_sources))
    assert same(found, ordinary)
    assert set(found["loaders"].values()) == {"SourcelessFileLoader"}


def test_from_a_frozen_program(bare: Path, folder: Path, frozen: Path, ordinary: dict[str, Any]) -> None:
    found = told(said(bare, folder, "python", "frozen.py", str(frozen), "test_user.py"))
    assert same(found, ordinary)
    assert set(found["loaders"].values()) == {"Loader"}


def test_isolated_optimised_and_where_nothing_may_be_written(
    installed: Path, folder: Path, ordinary: dict[str, Any]
) -> None:
    """`python -I -O -B` from folders without permission to write: afterwards every file is as it was."""
    place = Path(ordinary["place"]).parents[1]
    parts = [part for package in ("flexmb", "crosscheck") for part in (place / package, *(place / package).rglob("*"))]

    def state() -> dict[Path, int]:
        return {part: part.stat().st_mtime_ns for part in place.rglob("*")}

    before = state()
    for part in parts:
        part.chmod(0o555)
    try:
        found = told(said(installed, folder, "python", "-I", "-O", "-B", "test_user.py"))
        shipped = "from crosscheck.library.find import shipped_cases; assert shipped_cases()"
        said(installed, folder, "python", "-I", "-B", "-c", shipped)
    finally:
        for part in parts:
            part.chmod(0o755)
    assert same(found, ordinary)
    assert state() == before


@pytest.mark.slow
def test_without_docstrings(installed: Path, folder: Path, ordinary: dict[str, Any]) -> None:
    """`python -OO`: the compiler's own modules are others without theirs, so kernels have other names here."""
    found = told(said(installed, folder, "python", "-OO", "test_user.py"))
    assert found["end"] == ordinary["end"]


def test_crosscheck_asks_for_files(bare: Path, folder: Path, archive: Path) -> None:
    """It knows records by the sources that made them, and says so where there are none."""
    run = called(bare, folder, "python", "-m", "crosscheck", "list", path=archive)
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.startswith(f"crosscheck reads the source files of flexmb, and {archive / 'flexmb'} has none")
    assert "Traceback" not in run.stderr and "Install both with pip" in run.stderr


ASKED = {
    "cases": shipped_folder,
    "code that workers share": code_here.__wrapped__,
    "keys of records": lambda: sources(["crosscheck.engines.native"]),
}


@pytest.mark.parametrize("asked", ASKED.values(), ids=ASKED)
@pytest.mark.parametrize("file", ["flexmb.zip/flexmb/__init__.py", "__init__.pyc", None])
def test_python_calls_ask_for_files_too(
    asked: Any, file: str | None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """None of them takes no files for equal files: in a zip file, without sources, by a loader that names no place."""
    (tmp_path / "__init__.pyc").touch()
    monkeypatch.chdir(Path(own_files.__file__).parent)  # where there are sources, but those of a package beside it
    spec = ModuleSpec("flexmb", None, origin=None if file is None else str(tmp_path / file))
    monkeypatch.setattr(own_files, "find_spec", lambda name: spec)
    with pytest.raises(CaseError, match="Install both with pip"):
        asked()
