"""Compilation of kernels: with `kernel_cache.py`, `parts.py`, `bundle.py` and `pointer.py`, all that names numba.

`kernel` marks an entry point: compiled for the argument types of its first call, callable from Python, cached on disk.
`helper` marks a function that is called from kernels only: it is compiled into its callers, has no Python wrapper, no
machine code and no cache entry of its own (see `parts.py`). From Python, call its `.py_func`.

The disk cache is keyed by the sources a kernel can depend on: its own file and all that this imports, directly or not,
from the package. Numba by itself only looks at the file of the entry point, so that an edited helper in another file
would leave a stale, silently wrong kernel behind.
"""

from __future__ import annotations

import hashlib
import re
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from numba import config, njit, types
from numba.extending import overload
from numba.misc.appdirs import AppDirs

from flexmb.jit.cache import KernelCache, warn_once
from flexmb.jit.parts import PartCompiler

if config.DISABLE_JIT:
    raise ImportError(
        "flexmb runs compiled kernels only, and NUMBA_DISABLE_JIT is set: unset it. To look into a kernel, call its "
        "py_func, or see flexmb.jit.counting, which interprets kernels"
    )

# "contract" fuses a*b + c. No "nnan" or "ninf": they would let the compiler delete the checks that catch a blow-up.
_SEMANTICS: dict[str, Any] = {"fastmath": {"contract"}, "error_model": "numpy", "nogil": True}
_AS_PART: dict[str, Any] = {
    **_SEMANTICS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": PartCompiler
}  # fmt: skip


# Folders whose sources no kernel can depend on (held by a test): editing them recompiles nothing.
WITHOUT_KERNELS = ("scene", "modal", "dense", "surrogate")


_PACKAGE = Path(__file__).parents[1]

# "import module" or "from module import members", the members on the line or in parentheses. Parsing the sources in
# earnest would take longer than all the rest of a warm start.
_IMPORT = re.compile(
    rf"^\s*(?:from|import)\s+({_PACKAGE.name}\b[\w.]*)(?:\s+import\s+(\([^)]*\)|[^\n]*))?", re.MULTILINE
)


def source_hash(source: Path) -> str:
    """Hash of a source file and of everything of the package that it imports, directly or not: names and contents."""
    found, waiting = set[Path](), [source]
    while waiting:
        file = waiting.pop()
        if file not in found:
            found.add(file)
            waiting.extend(_imported(file))
    digest = hashlib.sha256()
    for file in sorted(found):
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


@cache
def _imported(source: Path) -> frozenset[Path]:
    """Files of the package that a source file imports by itself. The package has no relative imports."""
    names = set[str]()
    for module, members in _IMPORT.findall(source.read_text(encoding="utf-8")):
        names |= {module, *(f"{module}.{member}" for member in re.findall(r"\w+", members))}
    return frozenset(file for name in names for file in _files(name) if file.is_file())


def _files(module: str) -> Iterator[Path]:
    """Where a module of the package may be: a file, or a folder."""
    place = _PACKAGE.parent.joinpath(*module.split("."))
    yield place.with_suffix(".py")
    yield place / "__init__.py"


@cache
def cache_directory(source: Path) -> str | None:
    """Where the kernels of a source file are kept; None where nothing can be written.

    Below the directory that NUMBA_CACHE_DIR names, or else below numba's own cache directory of the user.
    """
    root = Path(config.CACHE_DIR or AppDirs(appname="numba", appauthor=False).user_cache_dir)
    directory = root / f"{_PACKAGE.name}-{source_hash(source)}"
    try:
        if directory.is_file():
            directory.unlink()
        directory.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=directory).close()
    except OSError as problem:
        warn_once(
            f"compiled kernels cannot be kept in {root} ({problem.strerror}), and every process compiles them again: "
            "permit writing there, or set NUMBA_CACHE_DIR to a folder where it is"
        )
        return None
    return str(directory)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` as an entry point, cached on disk."""
    compiled, directory = njit(**_SEMANTICS)(function), cache_directory(Path(function.__code__.co_filename))
    if directory is not None:
        compiled._cache = KernelCache(function, Path(directory))
    return compiled


def helper(function: Callable[..., Any]) -> Any:
    """Compile `function` into the kernels that call it."""
    return njit(**_AS_PART)(function)


def written_out(function: Callable[..., Any]) -> Any:
    """A helper that is written out where it is called.

    For the short ones around a call by address, which no optimiser sees through: arrays that are handed on once more on
    their way there are counted again. It takes longer to compile.
    """
    return njit(inline="always", **_AS_PART)(function)


def by_bundle(array: str, having: Callable[..., Any], lacking: Callable[..., Any]) -> Callable[..., Any]:
    """One helper for two kinds of bundles: `having` where the first argument has `array`, `lacking` where it has not.

    Decided by type, while the caller is compiled: a kernel is compiled once for each kind of bundle that it is called
    with, and contains nothing of the other.
    """

    def choose(bundle: Any, *args: Any) -> Any:
        return (having if hasattr(bundle, array) else lacking)(bundle, *args)

    @overload(choose, jit_options=_AS_PART)
    def _typed(bundle, *args):
        choice = having if array in dict(bundle.kinds) else lacking

        def call(bundle, *args):
            return choice(bundle, *args)

        return call

    choose.variants = (array, having, lacking)  # type: ignore[attr-defined]  # for who interprets kernels
    return choose


def by_number(real: Callable[..., Any], tangent: Callable[..., Any]) -> Callable[..., Any]:
    """One function for two kinds of numbers: `tangent` where an argument is complex, `real` where none is.

    Decided by type, while the caller is compiled, like `by_bundle`.
    """

    def choose(*args: Any) -> Any:
        return (tangent if any(isinstance(x, complex) for x in args) else real)(*args)

    @overload(choose, jit_options=_AS_PART)
    def _typed(*args):
        choice = tangent if any(isinstance(kind, types.Complex) for kind in args) else real

        def call(*args):
            return choice(*args)

        return call

    choose.of_reals = real  # type: ignore[attr-defined]  # for who interprets kernels
    return choose
