"""Python's collector of garbage held back while a large scene is read, checked or assembled."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def collector_paused() -> Iterator[None]:
    """No search for cycles within.

    Every object that is made there stays. Searching all of them for garbage again and again, as their number grows,
    takes longer than making them: twice the time at 10^5 bodies.
    """
    was_running = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_running:
            gc.enable()
