"""Python's search for garbage held back while a kernel is compiled, which takes a seventh less time without it.

The compiler makes millions of objects and keeps nearly all of them until it has finished.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def no_searches() -> Iterator[None]:
    """Within, and within what is compiled within."""
    was_running = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_running:
            gc.enable()
