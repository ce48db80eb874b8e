"""Of processes that want one kernel at once one compiles it, whatever becomes of it, and nobody waits for ever."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from flexmb.jit.once import compiled_once

ROOT = Path(__file__).parents[3]
# A process that compiles a tiny kernel slowly, once all processes are there, and prints whether it found it on disk.
WORKER = """
import sys, time
from contextlib import nullcontext
from pathlib import Path
from flexmb.jit import cache, hooks
from flexmb.jit.kernel import kernel

here, number, others, seconds = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), float(sys.argv[4])
if "alone" in sys.argv:
    cache.compiled_once = lambda file: nullcontext()
hooks.cache_directory = lambda: here / "kernels"
save = cache.KernelCache.save_overload

def slowly(self, signature, data):
    (here / f"compiled by {number}").touch()
    time.sleep(seconds)
    save(self, signature, data)

cache.KernelCache.save_overload = slowly

@kernel
def doubled(x):
    return 2.0 * x

(here / f"started {number}").touch()
while len([*here.glob("started *")]) < others:
    time.sleep(0.01)
assert doubled(1.5) == 3.0
print(sum(doubled.stats.cache_hits.values()))
"""


def start(here: Path, number: int, others: int, seconds: float, *options: str) -> subprocess.Popen:
    words = [str(here), str(number), str(others), str(seconds), *options]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.Popen([sys.executable, "-c", WORKER, *words], env=environment, stdout=subprocess.PIPE, text=True)


def found(process: subprocess.Popen) -> int:
    text, _ = process.communicate(timeout=120)
    assert process.returncode == 0
    return int(text)


def wait_for(file: Path) -> None:
    end = time.monotonic() + 120.0
    while not file.exists():
        assert time.monotonic() < end, f"{file} never came"
        time.sleep(0.01)


def kinds(folder: Path) -> set[str]:
    return {file.suffix for file in folder.iterdir()}


def test_one_of_two_processes_compiles(tmp_path):
    crew = [start(tmp_path, number, 2, 1.0) for number in range(2)]
    assert sorted(found(each) for each in crew) == [0, 1]
    assert len([*tmp_path.glob("compiled by *")]) == 1
    assert kinds(tmp_path / "kernels") == {".kernel"}


def test_without_the_lock_both_do(tmp_path):
    """The count above sees it."""
    crew = [start(tmp_path, number, 2, 1.0, "alone") for number in range(2)]
    assert [found(each) for each in crew] == [0, 0]
    assert len([*tmp_path.glob("compiled by *")]) == 2


def test_who_is_killed_at_it_is_followed_by_the_next(tmp_path):
    killed = start(tmp_path, 0, 1, 600.0)
    wait_for(tmp_path / "compiled by 0")
    waiting = start(tmp_path, 1, 2, 0.0)
    wait_for(tmp_path / "started 1")
    time.sleep(0.5)
    assert waiting.poll() is None
    killed.kill()
    killed.communicate()
    assert found(waiting) == 0
    assert kinds(tmp_path / "kernels") == {".kernel"}
    assert found(start(tmp_path, 2, 2, 0.0)) == 1


def test_patience_ends(tmp_path):
    """Whoever holds the lock may hang."""
    hanging = start(tmp_path, 0, 1, 600.0)
    try:
        wait_for(tmp_path / "compiled by 0")
        [lock] = (tmp_path / "kernels").glob("*.lock")
        begun = time.monotonic()
        with compiled_once(lock.with_suffix(""), patience=0.3):
            assert time.monotonic() - begun >= 0.3
        assert lock.exists()
    finally:
        hanging.kill()
        hanging.wait()
        hanging.stdout.close()


def test_where_there_are_no_locks_everybody_compiles(tmp_path):
    (tmp_path / "kernels").write_text("no folder")
    done = []
    with compiled_once(tmp_path / "kernels" / "a.kernel"):
        done.append("compiled")
    assert done == ["compiled"]


def test_an_error_of_the_compiler_frees_the_lock(tmp_path):
    file = tmp_path / "a.kernel"
    for _ in range(2):
        with pytest.raises(ValueError, match="no kernel"), compiled_once(file, patience=0.0):
            raise ValueError("no kernel")
    assert [each.name for each in tmp_path.iterdir()] in ([], ["a.kernel.lock"])
