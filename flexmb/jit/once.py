"""A kernel that is not on disk yet is compiled by one process, while other processes that need it wait for its file.

Compiling takes seconds to minutes of processor time, and the workers of a session start at the same time with the same
scenes. The process that compiles holds a lock on a file beside the kernel's. The operating system releases the lock
when the process ends in any way, and no process waits longer than `PATIENCE`. Without locks (on a file system that has
none, or in a folder that is not writable) every process compiles. The lock only saves work: nothing else depends on it,
because kernels are written atomically.

Threads of one process are serialised by numba's lock, which is taken before that of a file, and llvmlite's lock is
taken after both. A lock that another thread holds during a fork is never released in the child, whose first kernel
would wait for it without end. Therefore forking waits until these locks are free.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

from llvmlite.binding import ffi
from numba.core.compiler_lock import global_compiler_lock

from flexmb.forks import fork_waits_for

PATIENCE = 600.0  # s; the longest kernel takes a tenth of it on an idle processor


class _OfFingerprints:
    """The lock that Python 3.11 holds while any kernel's fingerprint is found; later versions have none."""

    def __enter__(self) -> None:
        cache = getattr(sys.modules.get(f"{__package__}.cache"), "KernelCache", None)  # its module imports this one
        self._lock: Any = getattr(vars(cache)["_fingerprint"] if cache else None, "lock", nullcontext())
        self._lock.__enter__()

    def __exit__(self, *error: object) -> None:
        self._lock.__exit__(*error)


# llvmlite's lock is not public; should it move in a later version, forks do not wait for it.
fork_waits_for(global_compiler_lock, getattr(getattr(ffi, "lib", None), "_lock", nullcontext()), _OfFingerprints())


@contextmanager
def compiled_once(file: Path, patience: float = PATIENCE) -> Iterator[None]:
    """Hold the lock of a kernel's file; if another process has written the file meanwhile, the body finds it."""
    from filelock import FileLock, Timeout  # imported here, because it is needed only for compiling

    lock = FileLock(file.with_name(f"{file.name}.lock"))
    try:
        file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)  # if somebody has removed it meanwhile
        lock.acquire(timeout=patience)
    except (OSError, NotImplementedError, Timeout):
        yield
        return
    try:
        yield
    finally:
        with suppress(OSError):
            if file.is_file():  # its lock is not needed any more
                Path(lock.lock_file).unlink()
        with suppress(OSError):
            lock.release()
