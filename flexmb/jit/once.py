"""A kernel that is not on disk yet is compiled by one process, while the others that want it wait for its file.

Compiling takes seconds to minutes of a processor, and the workers of a session start at once with the same scenes. Who
compiles holds a lock on a file beside the kernel's. The operating system frees it when its holder ends, however it
ends; nobody waits longer than `PATIENCE`; and where there are no locks (a file system without them, a folder that
nobody may write to) everybody compiles for himself, as without this file. Kernels are written whole or not at all, so
that a lock saves work and nothing else depends on it.

Threads of one process wait for each other by numba's lock, which is taken before that of a file, and llvmlite's after
both. A process that is forked off while another thread holds one of them would find it held for ever, at its first
kernel: so the fork waits until they are free.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

from llvmlite.binding import ffi
from numba.core.compiler_lock import global_compiler_lock

PATIENCE = 600.0  # s; the longest kernel takes a tenth of it on an idle processor


# llvmlite has no name for its lock; where it comes to be elsewhere, forks go on without waiting for it.
_LOCKS: tuple[Any, ...] = (global_compiler_lock, getattr(getattr(ffi, "lib", None), "_lock", nullcontext()))


def _take() -> None:
    for lock in _LOCKS:
        lock.__enter__()


def _let_go() -> None:
    for lock in reversed(_LOCKS):
        lock.__exit__(None, None, None)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_take, after_in_parent=_let_go, after_in_child=_let_go)


@contextmanager
def compiled_once(file: Path, patience: float = PATIENCE) -> Iterator[None]:
    """Hold the lock of a kernel's file; if another process wrote the file meanwhile, it is there for the body."""
    from filelock import FileLock, Timeout  # only who compiles needs it

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
            if file.is_file():  # nobody asks for its lock any more
                Path(lock.lock_file).unlink()
        with suppress(OSError):
            lock.release()
