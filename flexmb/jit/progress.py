"""A message when compiling takes longer than two seconds: what is being compiled, and that this is done once.

A kernel is compiled once for each kind of arguments, for example an integrator for runs with events and for runs
without. Messages about one kernel therefore number its versions, and no message is repeated. Kernels that it calls are
compiled with it without a message.

It is a warning of the logger `flexmb.jit`, which Python shows on stderr unless the program has set up its logging:
`logging.getLogger("flexmb.jit").setLevel(logging.ERROR)` silences it.
"""

from __future__ import annotations

import logging
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from types import FunctionType

from flexmb.jit.installed import unfit

AFTER = 2.0  # s
_LOGGER = logging.getLogger("flexmb.jit")
# Of announced versions by the name of the kernel. It is counted without a lock, which a forked process could inherit.
_versions: dict[str, Iterator[int]] = {}
_thread = threading.local()  # has an attribute `announcing` while this thread compiles


@contextmanager
def announced(function: FunctionType, folder: Path | None) -> Iterator[None]:
    """Announce after `AFTER` that a kernel is being compiled, and why this is necessary."""
    if hasattr(_thread, "announcing"):
        yield
        return
    timer = threading.Timer(AFTER, _announce, (function, folder))
    timer.daemon = True
    timer.start()
    _thread.announcing = True
    try:
        yield
    finally:
        del _thread.announcing
        timer.cancel()


def _announce(function: FunctionType, folder: Path | None) -> None:
    name = f"{function.__module__}.{function.__qualname__}"
    version = next(_versions.setdefault(name, count(1)))
    purpose = re.split(r"[.;:\n]", (function.__doc__ or "a kernel").strip(), maxsplit=1)[0]
    which = name if version == 1 else f"version {version} of {name}"
    how_often = f"once: it is kept in {folder}" if folder else "in every process: no folder is writable to keep it"
    why = f" (no general kernel can be taken: {unfit()})" if unfit() else ""
    _LOGGER.warning("flexmb is compiling %s (%s) for scenes of this kind, %s%s", which, purpose, how_often, why)
