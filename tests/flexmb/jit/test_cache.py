"""The cache of compiled kernels: whatever happens to its files, results stay right and nothing ends in a traceback."""

import itertools
import math
import os
import shutil
import subprocess
import sys
import warnings
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from flexmb import forks, jit
from flexmb.jit import folder as folders
from flexmb.jit import hooks
from flexmb.jit.cache import _digest
from flexmb.jit.folder import cache_directory, delete_unused, warn_once
from flexmb.jit.kernel import handed_on, helper, kernel, sweep
from flexmb.scene import garbage as collector

ROOT = Path(__file__).parents[3]
TINY = """
from flexmb.tables.soundness import unsound as kernel
import numpy as np
result = kernel(np.array([1.0, np.nan]), np.zeros(0, np.int64)), kernel(np.ones(2), np.zeros(0, np.int64))
assert result == (1, 0), result
"""
REAL = """
from flexmb.integrate.rk4 import rk4 as kernel
from tests.flexmb.integrate.integration_problems import HARMONIC, exact, solve
assert abs(solve(HARMONIC, [0.0, 1.0], step=1e-2).last - exact(HARMONIC, 1.0)).max() < 1e-6
"""
ALONE = """
from flexmb.jit import cache
cache.installed_directory = lambda: None  # what came with the installation would be found before anything is compiled
"""
HITS = "\nprint(sum(kernel.stats.cache_hits.values()))"
PROBES = {"tiny": ALONE + TINY + HITS, "real": ALONE + REAL + HITS}


def run(cache: Path, probe: str, *options: str) -> subprocess.CompletedProcess:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, *options, "-c", PROBES[probe]]
    done = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done


def kernels(cache: Path) -> list[Path]:
    found = sorted(cache.rglob("*.kernel"))
    assert found
    return found


def emptied(file: Path) -> None:
    file.write_bytes(b"")


def cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-100])


def garbage(file: Path) -> None:
    file.write_bytes(os.urandom(5000))


def flipped(file: Path) -> None:
    """One bit in the machine code."""
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(bytes(data))


def folder(file: Path) -> None:
    file.unlink()
    file.mkdir()
    (file / "inside").write_text("")


DAMAGES = (emptied, cut, garbage, flipped, folder)


def weighted(values, weight):
    """A tiny kernel, of integers or of floats."""
    total = 0.0
    for value in values:
        total += weight * value
    return total


def hits(cache: Path, monkeypatch) -> int:
    """Versions of the kernel that were found in a cache: of two."""
    monkeypatch.setattr(hooks, "cache_directory", lambda: cache / "sources")
    warn_once.cache_clear()
    delete_unused.cache_clear()
    fresh = kernel(weighted)
    assert fresh(np.arange(4), 2.0) == 12.0
    assert fresh(np.array([0.5, 0.25]), 2.0) == 1.5
    return sum(fresh.stats.cache_hits.values())


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_files_are_compiled_anew_with_one_warning(damage, tmp_path, monkeypatch):
    assert [hits(tmp_path, monkeypatch) for _ in range(2)] == [0, 2]
    for file in kernels(tmp_path):
        damage(file)
    with pytest.warns(RuntimeWarning, match="damaged files in") as warned:
        assert hits(tmp_path, monkeypatch) == 0
    assert len(warned) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert hits(tmp_path, monkeypatch) == 2


def test_files_that_changed_names_are_not_taken_for_each_other(tmp_path, monkeypatch):
    """Two processes that compile for different types at once could do that to an index."""
    hits(tmp_path, monkeypatch)
    one, other = kernels(tmp_path)
    swapped = other.read_bytes(), one.read_bytes()
    one.write_bytes(swapped[0])
    other.write_bytes(swapped[1])
    with pytest.warns(RuntimeWarning, match="damaged files in"):
        assert hits(tmp_path, monkeypatch) == 0


def test_one_damaged_file_costs_one_kernel(tmp_path, monkeypatch):
    hits(tmp_path, monkeypatch)
    cut(kernels(tmp_path)[0])
    with pytest.warns(RuntimeWarning, match="damaged files in"):
        assert hits(tmp_path, monkeypatch) == 1


@pytest.mark.slow
def test_a_real_kernel_is_repaired_too(tmp_path):
    """All of its files at once, each by another damage: one warning."""
    assert run(tmp_path, "real").stdout.strip() == "0"
    files = kernels(tmp_path)
    assert len(files) >= 3
    for file, damage in zip(files, itertools.cycle(DAMAGES), strict=False):
        damage(file)
    repaired = run(tmp_path, "real")
    assert repaired.stdout.strip() == "0"
    assert repaired.stderr.count("RuntimeWarning: damaged files in") == 1
    assert run(tmp_path, "real").stdout.strip() == "1"


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="who may do everything is locked out of nothing")
def test_a_file_without_permission_is_replaced(tmp_path, monkeypatch):
    hits(tmp_path, monkeypatch)
    for file in kernels(tmp_path):
        file.chmod(0)
    with pytest.warns(RuntimeWarning, match="damaged files in"):
        assert hits(tmp_path, monkeypatch) == 0


@pytest.mark.filterwarnings("ignore:damaged files")
def test_a_kernel_that_cannot_be_kept_runs_with_one_warning(tmp_path, monkeypatch):
    (tmp_path / "sources").write_text("no folder")
    with pytest.warns(RuntimeWarning, match="cannot be kept .* NUMBA_CACHE_DIR") as warned:
        assert hits(tmp_path, monkeypatch) == 0
    assert len({str(warning.message) for warning in warned}) == len(warned)


def wave(x):
    return math.sin(x) + math.exp(-x) * math.atan(x)


@sweep
def interfering(function, x):
    """So long that no optimiser writes it out where it is called: the function is handed on."""
    first = function(x) * function(2.0 * x) + function(3.0 * x) * function(5.0 * x)
    second = function(7.0 * x) * function(11.0 * x) + function(13.0 * x) * function(17.0 * x)
    return first + second + function(19.0 * x) * function(23.0 * x) + function(29.0 * x) * function(31.0 * x)


HANDED_ON, PLAIN = handed_on(wave), helper(wave)


def of_handed_on(x):
    return interfering(HANDED_ON, x)


def of_plain(x):
    return interfering(PLAIN, x)


EXPECTED = interfering.py_func(wave, 0.1)


@pytest.mark.filterwarnings("error")
def test_a_kernel_that_hands_a_function_on_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(hooks, "cache_directory", lambda: tmp_path)
    first, second = kernel(of_handed_on), kernel(of_handed_on)
    assert first(0.1) == second(0.1) == pytest.approx(EXPECTED, rel=1e-14)
    assert sum(second.stats.cache_hits.values()) == len(kernels(tmp_path)) == 1
    assert HANDED_ON(0.1) == HANDED_ON.py_func(0.1) == wave(0.1)


def test_of_a_kernel_that_cannot_be_kept_a_warning_says_that_it_is_a_defect(tmp_path, monkeypatch):
    """A plain helper in place of one that is handed on."""
    monkeypatch.setattr(hooks, "cache_directory", lambda: tmp_path)
    warn_once.cache_clear()
    with pytest.warns(RuntimeWarning, match=r"test_cache.of_plain holds addresses .* defect of flexmb's") as warned:
        assert kernel(of_plain)(0.1) == pytest.approx(EXPECTED, rel=1e-14)
    assert len(warned) == 1 and not list(tmp_path.rglob("*.kernel"))


def test_a_file_in_place_of_the_folder_is_replaced(tmp_path, monkeypatch):
    monkeypatch.setattr(folders.config, "CACHE_DIR", str(tmp_path))
    place = cache_directory.__wrapped__()
    place.rmdir()
    place.write_text("no folder")
    assert cache_directory.__wrapped__() == place
    assert place.is_dir()


def test_kernels_that_nobody_uses_are_forgotten_when_others_are_compiled(tmp_path, monkeypatch):
    hits(tmp_path, monkeypatch)
    earlier = tmp_path / "sources" / "of-earlier-sources.kernel"
    unfinished, strange = earlier.with_name("killed.kernel.0123"), earlier.with_name("README.md")
    for file in (earlier, unfinished, strange):
        file.write_text("")
    compiled = sorted((tmp_path / "sources").glob("weighted-*"))
    for file in (earlier, unfinished, strange, *compiled):
        os.utime(file, (0, 0))
    assert hits(tmp_path, monkeypatch) == 2
    assert earlier.exists()  # nothing was compiled
    compiled[0].unlink()
    assert hits(tmp_path, monkeypatch) == 1
    assert (earlier.exists(), unfinished.exists(), strange.exists()) == (False, False, True)
    assert kernels(tmp_path) == compiled


def test_a_checkout_beside_the_cache_is_no_part_of_it(tmp_path, monkeypatch):
    """NUMBA_CACHE_DIR may be where somebody keeps the project."""
    monkeypatch.setattr(folders.config, "CACHE_DIR", str(tmp_path))
    assert cache_directory.__wrapped__() not in (tmp_path / "flexmb", tmp_path)


def test_where_nothing_can_be_written_a_warning_says_so_and_kernels_run(tmp_path):
    place = tmp_path / "file"
    place.write_text("")
    done = run(place, "tiny")
    assert done.stderr.count("RuntimeWarning: compiled kernels cannot be kept") == 1
    assert "NUMBA_CACHE_DIR" in done.stderr


def test_processes_that_compile_at_once_share_one_sound_cache(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-W", "error", "-c", PROBES["tiny"]]
    started = [subprocess.Popen(command, env=environment, cwd=ROOT, stdout=subprocess.DEVNULL) for _ in range(2)]
    assert [each.wait() for each in started] == [0] * 2
    assert run(tmp_path, "tiny", "-W", "error").stdout.strip() == "1"
    assert all(file.suffix == ".kernel" for file in tmp_path.rglob("*") if file.is_file())


def test_without_the_compiler_one_line_says_why():
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(ROOT)}

    def stderr(code: str) -> str:
        done = subprocess.run([sys.executable, "-c", code], env=environment, cwd=ROOT, capture_output=True, text=True)
        assert done.returncode != 0
        return done.stderr

    last = stderr("import flexmb; flexmb.compile").splitlines()[-1]
    assert last.startswith("ImportError: flexmb runs compiled kernels")
    scene = next((ROOT / "cases").rglob("scene.toml"))
    command = f"['flexmb', 'simulate', {str(scene)!r}, '--t-end', '1']"
    words = stderr(f"import sys; sys.argv = {command}; import flexmb.cli; flexmb.cli.main()")
    assert len(words.splitlines()) == 1 and "NUMBA_DISABLE_JIT is set" in words


EDITED = "from flexmb.entry import entry; print(entry(1.0), sum(entry.stats.cache_hits.values()))"
ENTRY = """
from flexmb.jit.kernel import handed_on, helper, kernel, sweep
from .part import part

@kernel
def entry(x):
    return part(x)
"""
PART = """
from flexmb.jit.kernel import helper

@helper
def part(x):
    "{words}"
    return {factor} * x
"""


def test_an_edited_helper_in_another_file_is_compiled_and_edited_words_are_not(tmp_path):
    """A package of its own: the room jit and what it needs of others, a kernel, and a helper in another file."""
    package = tmp_path / "flexmb"
    shutil.copytree(Path(jit.__file__).parent, package / "jit")
    (package / "scene").mkdir()
    shutil.copy(collector.__file__, package / "scene")
    shutil.copy(forks.__file__, package)
    (package / "__init__.py").write_text("")
    (package / "entry.py").write_text(ENTRY)
    # Python takes its own compiled text of a file that was edited within a second and is as long as before.
    environment = os.environ | {"PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    environment["NUMBA_CACHE_DIR"] = str(tmp_path / "cache")

    def run(factor: float, words: str) -> str:
        (package / "part.py").write_text(PART.format(factor=factor, words=words))
        command = [sys.executable, "-c", EDITED]
        done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=True)
        return done.stdout.strip()

    assert run(2.0, "Times two.") == "2.0 0"
    assert run(2.0, "Two times what it takes.") == "2.0 1"
    assert run(3.0, "Two times what it takes.") == "3.0 0"
    assert run(2.0, "Two times.") == "2.0 1"


def belongs_to_another(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if os.geteuid() == 0:
        os.chown(path, 12345, -1)
    else:
        monkeypatch.setattr(folders.os, "geteuid", lambda: path.stat().st_uid + 1)


STRANGERS = {
    "everybody may write to the folder": lambda place, _: place.chmod(0o777),
    "a group may": lambda place, _: place.chmod(0o770),
    "everybody may write to a file": lambda place, _: (place / "a.kernel").chmod(0o666),
    "the folder is another's": belongs_to_another,
    "a file is another's": lambda place, monkeypatch: belongs_to_another(place / "a.kernel", monkeypatch),
    "everybody may rename the folder": lambda place, _: place.parent.chmod(0o777),
}


@pytest.mark.skipif(sys.platform == "win32", reason="modes say nothing there")
@pytest.mark.parametrize("how", STRANGERS)
def test_kernels_that_others_may_have_written_are_not_used(how, tmp_path, monkeypatch):
    monkeypatch.setattr(folders.config, "CACHE_DIR", str(tmp_path / "numba"))
    warn_once.cache_clear()
    place = cache_directory.__wrapped__()
    (place / "a.kernel").write_bytes(b"")
    (place / "a.kernel").chmod(0o644)
    place.chmod(0o755)  # as before it was closed, or by another mask
    assert cache_directory.__wrapped__() == place
    STRANGERS[how](place, monkeypatch)
    with pytest.warns(RuntimeWarning, match="run as code: remove the folder"):
        assert cache_directory.__wrapped__() is None
    warn_once.cache_clear()


@pytest.mark.skipif(sys.platform == "win32", reason="modes say nothing there")
def test_a_new_folder_is_the_users_alone(tmp_path, monkeypatch):
    """Whatever the mask: many systems let the user's group write."""
    monkeypatch.setattr(folders.config, "CACHE_DIR", str(tmp_path / "numba"))
    before = os.umask(0o002)
    try:
        place = cache_directory.__wrapped__()
        (place / "a.kernel").write_bytes(b"")
    finally:
        os.umask(before)
    assert place.stat().st_mode & 0o777 == 0o700
    assert cache_directory.__wrapped__() == place


@pytest.mark.skipif(sys.platform == "win32", reason="modes say nothing there")
def test_a_planted_kernel_is_not_unpickled(tmp_path):
    """Its digest is right: whoever can write can compute it."""
    run(tmp_path, "tiny")
    (file,) = kernels(tmp_path)
    planted = b"cos\nsystem\n(S'touch " + str(tmp_path / "ran").encode() + b"'\ntR."
    file.write_bytes(_digest(file, planted) + planted)
    file.parent.chmod(0o777)
    done = run(tmp_path, "tiny")
    assert done.stdout.split() == ["0"] and "others may write to it" in done.stderr
    assert not (tmp_path / "ran").exists()


def test_a_file_that_is_renamed_while_the_folder_is_looked_at_is_no_stranger(tmp_path, monkeypatch):
    """Processes that start at once write kernels under one name and rename them: nobody loses the folder by that."""
    (tmp_path / "written").write_text("kernel")
    look = os.scandir

    @contextmanager
    def renamed(directory):
        with look(directory) as entries:
            found = list(entries)
        (tmp_path / "written").rename(tmp_path / "kept")
        yield found

    tmp_path.chmod(0o700)
    monkeypatch.setattr(folders.os, "scandir", renamed)
    assert folders._stranger(tmp_path) is None
