"""The cache of compiled kernels: whatever happens to its files, results stay right and nothing ends in a traceback."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TINY = """
from flexmb.soundness import unsound as kernel
import numpy as np
result = kernel(np.array([1.0, np.nan]), np.zeros(0, np.int64)), kernel(np.ones(2), np.zeros(0, np.int64))
assert result == (1, 0), result
"""
REAL = """
from flexmb.integrate.rk4 import rk4 as kernel
from tests.flexmb.integrate.integration_problems import HARMONIC, exact, solve
assert abs(solve(HARMONIC, [0.0, 1.0], step=1e-2).last - exact(HARMONIC, 1.0)).max() < 1e-6
"""
HITS = "\nprint(sum(kernel.stats.cache_hits.values()))"
PROBES = {"tiny": TINY + HITS, "real": REAL + HITS}


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


def locked(file: Path) -> None:
    file.chmod(0)


def renamed(file: Path) -> None:
    """What belongs to other types, under this name."""
    others = [other for other in kernels(file.parents[1]) if other != file]
    file.write_bytes(others[0].read_bytes() if others else b"other")


DAMAGES = (emptied, cut, garbage, flipped, folder, renamed)


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_files_are_compiled_anew_with_one_warning(damage, tmp_path):
    assert run(tmp_path, "tiny").stdout.strip() == "0"
    assert run(tmp_path, "tiny").stdout.strip() == "1"
    for file in kernels(tmp_path):
        damage(file)
    repaired = run(tmp_path, "tiny")
    assert repaired.stdout.strip() == "0"
    assert repaired.stderr.count("damaged files in") == 1
    again = run(tmp_path, "tiny")
    assert (again.stdout.strip(), again.stderr) == ("1", "")


def test_a_real_kernel_is_repaired_too(tmp_path):
    """All of its files at once, each by another damage: one warning."""
    run(tmp_path, "real")
    files = kernels(tmp_path)
    assert len(files) >= 3
    for file, damage in zip(files, DAMAGES, strict=False):
        damage(file)
    repaired = run(tmp_path, "real")
    assert repaired.stdout.strip() == "0"
    assert repaired.stderr.count("damaged files in") == 1
    assert run(tmp_path, "real").stdout.strip() == "1"


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="who may do everything is locked out of nothing")
def test_a_file_without_permission_is_replaced(tmp_path):
    run(tmp_path, "tiny")
    for file in kernels(tmp_path):
        locked(file)
    assert "damaged files in" in run(tmp_path, "tiny").stderr


def test_a_file_in_place_of_the_folder_is_replaced(tmp_path):
    run(tmp_path, "tiny")
    for each in list(tmp_path.iterdir()):
        for file in each.iterdir():
            file.unlink()
        each.rmdir()
        each.write_text("not a folder")
    run(tmp_path, "tiny")
    assert run(tmp_path, "tiny").stdout.strip() == "1"


def test_where_nothing_can_be_written_a_warning_says_so_and_kernels_run(tmp_path):
    place = tmp_path / "file"
    place.write_text("")
    done = run(place, "tiny")
    assert done.stderr.count("cannot be kept") == 1
    assert "NUMBA_CACHE_DIR" in done.stderr


def test_processes_that_compile_at_once_share_one_sound_cache(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-W", "error", "-c", PROBES["tiny"]]
    started = [subprocess.Popen(command, env=environment, cwd=ROOT, stdout=subprocess.DEVNULL) for _ in range(4)]
    assert [each.wait() for each in started] == [0] * 4
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
