"""Hooks into numba's internals: they are in use with the numba installed here, and there is a way without them."""

import os
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

from flexmb.jit import hooks
from flexmb.jit.bundle import bundle
from flexmb.jit.cache import KernelCache
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.parts import PartCompiler, _PartLibrary

ROOT = Path(__file__).parents[3]


@bundle
class Numbers:
    values: np.ndarray


@helper
def doubled(numbers, i):
    return 2.0 * numbers.values[i]


@kernel
def total(numbers):
    found = 0.0
    for i in range(numbers.values.shape[0]):
        found += doubled(numbers, i)
    return found


@kernel
def first_or_all(numbers, all_of_them):
    found = numbers.values[0]
    if all_of_them:
        for i in range(1, numbers.values.shape[0]):
            found += numbers.values[i]
    return found


@kernel
def all_but_the_first(numbers):
    return first_or_all(numbers, True) - first_or_all(numbers, False)


@pytest.fixture
def compiled(tmp_path, monkeypatch):
    """Compiled in this test, for a helper has no versions where its kernel was found on disk."""
    monkeypatch.setattr(hooks, "cache_directory", lambda: tmp_path)
    fresh = kernel(total.py_func)
    assert fresh(Numbers(np.arange(4.0))) == 12.0
    return fresh


def test_the_hooks_are_in_use():
    """With a numba that nobody tried yet this fails: try it, then move the bounds in `hooks` and pyproject.toml."""
    assert hooks.Hooks() != hooks.HOOKS, f"numba {numba.__version__} takes none of the hooks"
    assert hooks.HOOKS.parts["pipeline_class"] is PartCompiler


def test_a_kernel_is_compiled_once_for_all_constants_that_kernels_call_it_with():
    assert all_but_the_first(Numbers(np.arange(1.0, 5.0))) == 9.0
    [(_, flag)] = first_or_all.overloads
    assert flag == numba.types.boolean


def test_helpers_are_parts_without_machine_code(compiled):
    [version] = doubled.overloads.values()
    assert type(version.library) is _PartLibrary
    assert version.library._finalized
    assert "doubled" in version.library.get_llvm_str()


def test_the_dispatcher_asks_our_cache(compiled, tmp_path):
    assert isinstance(compiled._cache, KernelCache)
    assert len(list(tmp_path.glob("total-*.kernel"))) == 1
    again = kernel(total.py_func)
    assert again(Numbers(np.ones(2))) == 4.0
    assert sum(again.stats.cache_hits.values()) == 1


def test_addresses_of_a_bundle_are_loaded_once(compiled):
    """A loop over an array of a bundle does not read its address again and again."""
    [text] = compiled.inspect_llvm().values()
    assert "!invariant.load" in text


WHICH = """
import warnings
import numba
numba.njit(lambda x: x)(1.0)  # numba itself has all it needs
{hidden}
with warnings.catch_warnings(record=True) as warned:
    warnings.simplefilter("always")
    import flexmb.run.simulate
    from flexmb.jit.hooks import HOOKS, Hooks
    told = [each.message for each in warned if each.category is RuntimeWarning]
    print("plain" if HOOKS == Hooks() else "hooks", *told)
"""
NUMBERS = """
import numpy as np
from flexmb.tables.soundness import unsound
from tests.flexmb.jit.test_bundle import choose, fill_inner, Nested, pair
print(fill_inner(Nested(pair(), np.array([1.0, 3.0])), 2.0), choose(pair()), unsound(np.ones(2), np.zeros(0, np.int64)))
"""
RUN = """
from tests.flexmb.integrate.integration_problems import HARMONIC, solve
print(solve(HARMONIC, [0.0, 1.0], step=1e-2).last.tolist())
"""
HIDDEN = {
    "another version": "numba.__version__ = '0.99.1'",
    "a build without a number": "numba.__version__ = '0+unknown'",
    "a linker of another name": "import numba.core.codegen; del numba.core.codegen.JITCodeLibrary",
    "a cache of another name": "import numba.core.caching; del numba.core.caching.NullCache",
}


def probe(program: str, hidden: str = "") -> list[str]:
    """What it prints."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", program.format(hidden=hidden)]
    done = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def is_told(line):
    return line.startswith("plain numba ") and line.count("is not one that flexmb knows from inside") == 1


@pytest.mark.parametrize("hidden", [name for name in HIDDEN if name != "another version"])
def test_one_warning_says_that_the_hooks_are_not_used(hidden):
    [line] = probe(WHICH, HIDDEN[hidden])
    assert is_told(line)


@pytest.mark.parametrize("numbers", [NUMBERS, pytest.param(RUN, marks=pytest.mark.slow)], ids=["kernels", "a run"])
def test_without_the_hooks_results_are_the_same(numbers):
    first, *others = probe(WHICH + numbers)
    plain, *same = probe(WHICH + numbers, HIDDEN["another version"])
    assert first == "hooks" and is_told(plain) and same == others
