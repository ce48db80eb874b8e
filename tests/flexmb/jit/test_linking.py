"""Kernels that call kernels: code that is there once, never another than the caller was compiled for."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexmb.jit import hooks, linking
from flexmb.jit.kernel import helper, kernel

ROOT = Path(__file__).parents[3]
MODULE = """
from flexmb.jit.kernel import helper, kernel

@kernel
def total(values):
    result = 0.0
    for value in values:
        result += FACTOR * value
    return result

@helper
def between(values):
    return total(values)

@kernel
def mean(values):
    return between(values) / values.shape[0]

@kernel
def spread(values):
    return values[0] - total(values) / values.shape[0]
"""
USE = """
import numpy as np
from chained import mean, spread, total
print(mean(np.array([1.0, 2.0])), spread(np.array([1.0, 2.0])))
print(*[sum(each.stats.cache_hits.values()) for each in (mean, spread, total)])
"""


class Project:
    """A module of kernels that call each other, used by a process at a time, with a cache of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.write(1.0)

    def write(self, factor: float) -> None:
        (self._folder / "chained.py").write_text(MODULE.replace("FACTOR", str(factor)))

    def used(self) -> tuple[str, str]:
        """What a process prints: results; and how many kernels it has found: mean, spread, total."""
        path = os.pathsep.join([str(self._folder), str(ROOT)])
        environment = os.environ | {"PYTHONPATH": path, "NUMBA_CACHE_DIR": str(self._folder / "cache")}
        environment["PYTHONDONTWRITEBYTECODE"] = "1"  # Python does not see an edit within a second, of the same length
        command = [sys.executable, "-W", "ignore", "-c", USE]
        done = subprocess.run(command, env=environment, cwd=self._folder, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        results, found = done.stdout.splitlines()
        return results, found

    def file(self, name: str) -> Path:
        [found] = (self._folder / "cache").rglob(f"{name}-*.kernel")
        return found


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """After a first process, which compiles everything; each test leaves it like that."""
    made = Project(tmp_path_factory.mktemp("project"))
    assert made.used() == ("1.5 -0.5", "0 0 0")
    return made


def test_the_next_process_compiles_none(project: Project) -> None:
    assert project.used() == ("1.5 -0.5", "1 1 1")


@pytest.mark.parametrize("harm", [Path.unlink, lambda file: file.write_bytes(b"damaged")])
def test_a_callee_that_is_lost_is_compiled_anew_by_itself(project: Project, harm: Callable[[Path], object]) -> None:
    harm(project.file("total"))
    assert project.used() == ("1.5 -0.5", "1 1 0")
    assert project.used() == ("1.5 -0.5", "1 1 1")


def test_a_callee_that_was_edited_takes_its_callers_with_it(project: Project) -> None:
    project.write(2.0)
    assert project.used() == ("3.0 -2.0", "0 0 0")
    project.write(1.0)
    assert project.used() == ("1.5 -0.5", "1 1 1")


@kernel
def inner(x):
    """x[0] + 1, in a way that can be seen in the code of who has it."""
    return x[0] + 1.0 / 1234.5 * 1234.5


@helper
def middle(x):
    return 2.0 * inner(x)


@kernel
def outer(x):
    return middle(x) + inner(x)


def test_the_caller_has_a_symbol_and_nothing_of_the_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hooks, "cache_directory", lambda: tmp_path)
    fresh = kernel(outer.py_func)
    assert fresh(np.array([3.0])) == 12.0
    [callee] = fresh.overloads[fresh.signatures[0]].library.callees
    assert callee.name == "inner" and callee.arguments == inner.signatures[0]
    [code] = fresh.inspect_llvm().values()
    met = re.findall(r"^(declare|define) .*?@([^(]*)\(", code, re.MULTILINE)
    assert [(kind, name.strip('"')) for kind, name in met if "inner" in name] == [("declare", callee.symbol)]


def test_a_kernel_that_others_could_not_find_is_not_called(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hooks, "cache_directory", lambda: tmp_path)

    @kernel
    def hidden(x):
        return 2.0 * x[0]

    @kernel
    def calling(x):
        return hidden(x) + 1.0

    with pytest.raises(TypeError, match="hidden is called by a kernel: define it at the top of its module"):
        calling(np.array([3.0]))


@pytest.mark.parametrize(
    "change", [{"symbol": "flexmb.other"}, {"name": "no_such_kernel"}, {"module": "no.such.module"}, {"name": "ROOT"}]
)
def test_a_callee_that_is_no_more_what_it_was_is_not_linked(change: dict[str, str]) -> None:
    """Then the caller is compiled anew."""
    assert outer(np.array([3.0])) == 12.0
    library = inner.overloads[inner.signatures[0]].library
    callee = linking._codes[library].callee
    assert linking.resolve((callee,)) == (library,)
    assert linking.resolve((callee, replace(callee, **change))) is None
