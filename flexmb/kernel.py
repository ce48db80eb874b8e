"""Compilation of kernels: with `bundle.py`, the only file that names numba.

`kernel` marks an entry point: compiled for the argument types of its first call, callable from Python, cached on disk.
`helper` marks a function that is called from kernels only: it is compiled into its callers, has no Python wrapper and
no cache entry of its own (a third of the cold compile time of caching everything). From Python, call its `.py_func`.

The disk cache is keyed by the sources of the package, less the folders that hold no kernels. Numba by itself only looks
at the file of the entry point, so that an edited helper in another file would leave a stale, wrong kernel behind.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import config, njit
from numba.misc.appdirs import AppDirs

# "contract" fuses a*b + c. No "nnan" or "ninf": they would let the compiler delete the checks that catch a blow-up.
_SEMANTICS: dict[str, Any] = {"fastmath": {"contract"}, "error_model": "numpy", "nogil": True}


# Folders whose sources no kernel can depend on (held by a test): editing them recompiles nothing.
WITHOUT_KERNELS = ("scene", "modal", "dense")


def source_hash(package: Path) -> str:
    """Hash of the Python sources below `package` that kernels may depend on: names and contents."""
    digest = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        if source.relative_to(package).parts[0] in WITHOUT_KERNELS:
            continue
        digest.update(str(source.relative_to(package)).encode() + b"\0")
        digest.update(source.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _cache_directory() -> str | None:
    """Where kernels of exactly these sources are kept; None where nothing can be written.

    Below the directory that NUMBA_CACHE_DIR names, or else below numba's own cache directory of the user.
    """
    root = Path(config.CACHE_DIR or AppDirs(appname="numba", appauthor=False).user_cache_dir)
    directory = root / f"flexmb-{source_hash(Path(__file__).parent)}"
    try:
        directory.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=directory).close()
    except OSError:
        return None
    return str(directory)


CACHE_DIRECTORY = _cache_directory()


def kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` as an entry point, cached on disk."""
    if CACHE_DIRECTORY is None:
        return njit(**_SEMANTICS)(function)
    # Numba reads its cache directory while it decorates: set only here, other packages keep theirs.
    others, config.CACHE_DIR = config.CACHE_DIR, CACHE_DIRECTORY
    try:
        return njit(cache=True, **_SEMANTICS)(function)
    finally:
        config.CACHE_DIR = others


def helper(function: Callable[..., Any]) -> Any:
    """Compile `function` into the kernels that call it."""
    return njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, **_SEMANTICS)(function)


def generic(function: Callable[..., Any]) -> Any:
    """Write out `function`, which takes kernels as arguments, in every place it is called from.

    A kernel that is still passed around in the machine code is an address of this process: numba then refuses to cache
    the caller. Written out down to the entry point, which names the kernel, it is a direct call.
    """
    return njit(inline="always", no_cpython_wrapper=True, no_cfunc_wrapper=True, **_SEMANTICS)(function)
