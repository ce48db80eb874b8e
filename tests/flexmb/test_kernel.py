"""Bundles of arrays, and the disk cache that must not survive an edit."""

import ast
import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import flexmb.jit.kernel
from flexmb.jit.bundle import AnyBundle, bundle
from flexmb.jit.kernel import _imported, helper, kernel, source_hash
from flexmb.jit.pointer import NOTHING, REAL, STATUS, VECTOR, pointer


@bundle
class Pair:
    values: np.ndarray  # (n, 3)
    counts: np.ndarray  # (m,)


@helper
def scaled(pair, i, factor):
    return factor * pair.values[i, 2]


@bundle
class Other:
    counts: np.ndarray  # (m,)


@kernel
def fill(pair, factor):
    """Doubles the counts; returns the sum of the last column times `factor`."""
    total = 0.0
    for i in range(pair.values.shape[0]):
        total += scaled(pair, i, factor)
    for i in range(pair.counts.shape[0]):
        pair.counts[i] *= 2
    return total


def pair(rows: int = 4) -> Pair:
    return Pair(values=np.arange(3.0 * rows).reshape(rows, 3), counts=np.arange(5))


@pytest.mark.parametrize("rows", [4, 7])
def test_kernels_read_and_write_the_arrays_of_a_bundle(rows):
    arrays = pair(rows)
    assert fill(arrays, 2.0) == 2.0 * arrays.values[:, 2].sum()
    assert arrays.counts.tolist() == [0, 2, 4, 6, 8]


@bundle
class Nested:
    inner: Pair
    weights: np.ndarray  # (k,)


@kernel
def fill_inner(nested, factor):
    """As `fill`, times the sum of the weights."""
    total = 0.0
    for i in range(nested.weights.shape[0]):
        total += nested.weights[i]
    return total * fill(nested.inner, factor)


def test_bundles_hold_bundles():
    arrays = pair()
    assert fill_inner(Nested(arrays, np.array([1.0, 3.0])), 2.0) == 8.0 * arrays.values[:, 2].sum()
    assert arrays.counts.tolist() == [0, 2, 4, 6, 8]


@kernel
def trebled(t, y, dy, first, second):
    for i in range(y.shape[0]):
        dy[i] = 3.0 * y[i] + first.counts[0]
    return second.counts[0]


@kernel
def call(function, y, dy, first, second):
    return function(0.5, y, dy, first, second)


def pointed(first, second):
    return pointer(trebled, STATUS, REAL, VECTOR, VECTOR, first, second)


def test_a_kernel_that_calls_by_address_is_compiled_once_for_all_bundles():
    plain = pair()
    plain.counts[0] = 7
    y, dy = np.arange(3.0), np.empty(3)
    assert call(pointed(plain, plain), y, dy, AnyBundle(plain), AnyBundle(plain)) == 7
    assert dy.tolist() == [7.0, 10.0, 13.0]
    other = Other(counts=np.array([5]))
    assert call(pointed(plain, other), y, dy, AnyBundle(plain), AnyBundle(other)) == 5
    assert len(trebled.signatures) == 2
    assert len(call.signatures) == 1


def test_an_address_refuses_a_kernel_that_returns_something_else():
    with pytest.raises(TypeError, match="trebled returns int64, not none"):
        pointer(trebled, NOTHING, REAL, VECTOR, VECTOR, pair(), pair())


def test_a_pickled_bundle_has_its_own_arrays():
    original = pair()
    copied = pickle.loads(pickle.dumps(original))
    fill(copied, 1.0)
    assert original.counts.tolist() == [0, 1, 2, 3, 4]
    assert copied.counts.tolist() == [0, 2, 4, 6, 8]


def test_bundles_refuse_arrays_they_cannot_describe():
    with pytest.raises(ValueError, match="values: a bundle holds C-contiguous arrays"):
        Pair(values=np.zeros((4, 6))[:, ::2], counts=np.zeros(2))


def test_the_hash_follows_imports_through_the_package(tmp_path):
    """Two probes outside the package: one imports the dynamics, one only a file that imports nothing."""
    far, near = tmp_path / "far.py", tmp_path / "near.py"
    far.write_text("from flexmb.entry.articulated import rhs\n")
    near.write_text("from flexmb.tables.status import OK\n")
    assert source_hash(far) == source_hash(far)
    before = source_hash(near)
    near.write_text("from flexmb.tables.status import OK, NONFINITE\n")
    assert source_hash(near) != before
    package = Path(flexmb.jit.kernel.__file__).parents[1]
    assert {package / "tables" / "status.py"} == _imported(near)
    assert package / "entry" / "articulated.py" in _imported(far)
    assert package / "jain" / "sweeps.py" in _imported(package / "entry" / "articulated.py")


def test_the_imports_found_are_those_that_python_sees():
    package = Path(flexmb.jit.kernel.__file__).parents[1]
    for source in package.rglob("*.py"):
        seen = set()
        for node in ast.walk(ast.parse(source.read_bytes())):
            if isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{source}: the cache key does not follow relative imports"
                seen |= {str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)}
            elif isinstance(node, ast.Import):
                seen |= {alias.name for alias in node.names}
        places = [package.parent.joinpath(*name.split(".")) for name in seen if name.split(".")[0] == "flexmb"]
        files = {file for place in places for file in (place.with_suffix(".py"), place / "__init__.py")}
        assert {file for file in files if file.is_file()} <= _imported(source)


PROBE = "from flexmb.entry import entry; print(entry(1.0), sum(entry.stats.cache_hits.values()))"


def test_an_edited_helper_in_another_file_is_seen_and_an_unchanged_one_is_cached(tmp_path):
    package = tmp_path / "flexmb"
    shutil.copytree(Path(flexmb.jit.kernel.__file__).parent, package / "jit")
    (package / "__init__.py").write_text("")
    (package / "entry.py").write_text(
        "from flexmb.jit.kernel import kernel\nfrom flexmb.part import part\n\n\n"
        "@kernel\ndef entry(x):\n    return part(x)\n"
    )
    environment = os.environ | {"PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}

    def run(factor: float) -> str:
        (package / "part.py").write_text(
            f"from flexmb.jit.kernel import helper\n@helper\ndef part(x):\n    return {factor} * x\n"
        )
        done = subprocess.run(
            [sys.executable, "-c", PROBE], env=environment, cwd=tmp_path, capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    assert run(2.0) == "2.0 0"
    assert run(2.0) == "2.0 1"
    assert run(3.0) == "3.0 0"


def test_folders_left_out_of_the_cache_key_hold_no_kernels():
    package = Path(flexmb.jit.kernel.__file__).parents[1]
    for folder in flexmb.jit.kernel.WITHOUT_KERNELS:
        sources = list((package / folder).rglob("*.py"))
        assert sources, f"{folder} is not a folder of the package"
        assert not [source for source in sources if "flexmb.jit.kernel" in source.read_text(encoding="utf-8")]
