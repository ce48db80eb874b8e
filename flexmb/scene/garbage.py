"""Suspension of Python's garbage collector while a large scene is read, checked or assembled."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def collector_paused() -> Iterator[None]:
    """A context without garbage collection.

    The objects that are created within it remain in use. Repeated searches for cycles among a growing number of them
    take longer than creating them: at 10^5 bodies, twice as long.
    """
    was_running = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_running:
            gc.enable()
