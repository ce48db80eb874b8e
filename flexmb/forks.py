"""What a fork of the process waits for: locks of flexmb and of what it compiles with, and imports by other threads.

A child has none of its parent's other threads. A lock that one of them held is never released there, and a module that
one of them was importing is never finished there: whoever needs it waits without end.
"""

from __future__ import annotations

import _frozen_importlib
import _imp
import concurrent.futures.thread  # noqa: F401  (its hook and that of logging must be there before ours waits)
import os
import time
from threading import get_ident
from typing import Any

_OURS = {"flexmb", "numpy", "scipy", "msgspec"}  # what flexmb imports when it is needed; numba's imports have its lock
# Locks of modules are not public; should they move in a later version, forks do not wait for imports.
_importing: dict[str, Any] = getattr(_frozen_importlib, "_module_locks", {})
_locks: list[Any] = []
_held: list[Any] = []  # by the thread that forks


def fork_waits_for(*locks: Any) -> None:
    """Let forks wait until no other thread holds these locks; a thread takes them in the order of all such calls."""
    _locks.extend(locks)


def _take() -> None:
    """All locks, and the one under which an import begins, when no other thread imports.

    It holds none of them while it waits for an import, which may need them.
    """
    while True:
        for lock in _locks:
            lock.__enter__()
            _held.append(lock)
        _imp.acquire_lock()
        if not _others_import():
            return
        _let_go()
        time.sleep(1e-3)


def _let_go() -> None:
    _imp.release_lock()
    while _held:
        _held.pop().__exit__(None, None, None)


def _others_import() -> bool:
    """Whether another thread is importing one of our modules, or one that flexmb imports when it is needed."""
    modules = [_importing[name]() for name in list(_importing) if name.partition(".")[0] in _OURS]
    return any(getattr(lock, "owner", None) not in (None, get_ident()) for lock in modules)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_take, after_in_parent=_let_go, after_in_child=_let_go)
