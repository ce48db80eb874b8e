"""A message when compiling takes longer than two seconds: what is being compiled, and that this is done once.

A kernel is compiled once for each kind of arguments, for example a recursion for one state and for eight at once.
Messages about one kernel therefore number its versions, and no message is repeated. Kernels that it calls are compiled
with it without a message.

It is a warning of the logger `flexmb.jit`, which Python shows on stderr unless the program has set up its logging:
`logging.getLogger("flexmb.jit").setLevel(logging.ERROR)` silences it.

`spent` has the processor time of each kernel, which the installation keeps with what it has compiled. `unheard` is
for its processes.
"""

from __future__ import annotations

import logging
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from time import thread_time
from types import FunctionType

from flexmb.jit.installed import is_whole, unfit

AFTER = 2.0  # s
_LOGGER = logging.getLogger("flexmb.jit")
# Of announced versions by the name of the kernel. It is counted without a lock, which a forked process could inherit.
_versions: dict[str, Iterator[int]] = {}
_thread = threading.local()  # has an attribute `inner` while this thread compiles: s spent on kernels within a kernel

spent: dict[str, float] = {}
"""Processor time (s) that this process has spent on the versions of each kernel, without those of kernels it calls."""


@contextmanager
def announced(function: FunctionType, folder: Path | None) -> Iterator[None]:
    """Announce after `AFTER` that a kernel is being compiled, and why this is necessary."""
    start, around = thread_time(), getattr(_thread, "inner", None)
    _thread.inner = 0.0
    try:
        if around is None:
            with _watched(function, folder):
                yield
        else:
            yield
    finally:
        whole, name = thread_time() - start, _name(function)
        spent[name] = spent.get(name, 0.0) + whole - _thread.inner
        if around is None:
            del _thread.inner
        else:
            _thread.inner = around + whole


@contextmanager
def _watched(function: FunctionType, folder: Path | None) -> Iterator[None]:
    """Announce it, should it take long."""
    timer = threading.Timer(AFTER, _announce, (function, folder))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _name(function: FunctionType) -> str:
    return f"{function.__module__}.{function.__qualname__}"


def _announce(function: FunctionType, folder: Path | None) -> None:
    name = _name(function)
    version = next(_versions.setdefault(name, count(1)))
    purpose = re.split(r"[.;:\n]", (function.__doc__ or "a kernel").strip(), maxsplit=1)[0]
    which = name if version == 1 else f"version {version} of {name}"
    how_often = f"once: it is kept in {folder}" if folder else "in every process: no folder is writable to keep it"
    why = f" (no general kernel can be taken: {unfit()})" if unfit() else ""
    if not why and not is_whole():
        why = " (`flexmb warmup --all` compiles all general kernels that the installation left for later)"
    _LOGGER.warning("flexmb is compiling %s (%s) for scenes of this kind, %s%s", which, purpose, how_often, why)


def unheard() -> None:
    """In a process that only compiles, nobody asks numba how long it held its locks: at each call of LLVM it notes that
    once for every function whose compilation is not finished, which takes a fiftieth of compiling."""
    from numba.core import event

    event.start_event = event.end_event = _nobody_told


def _nobody_told(*_: object, **__: object) -> None:
    """In place of telling all who listen to an event."""
