"""How much a command shows."""

from __future__ import annotations

from enum import Enum


class Verbosity(Enum):
    """QUIET: the last line, and errors; NORMAL: some ten lines; VERBOSE: every comparison and every run."""

    QUIET = 0
    NORMAL = 1
    VERBOSE = 2
