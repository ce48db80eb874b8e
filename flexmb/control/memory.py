"""What controllers know at the end of a run, so that it can be taken up there."""

from __future__ import annotations

from typing import NamedTuple

from flexmb.typing import Real


class LoopMemory(NamedTuple):
    """signal (S,) and state of all controllers as `flexmb.control.tables.Loop` has them; held (rows,m): what sampled
    ones put out since t = 0; instants (1,): how many there have been."""

    signal: Real
    state: Real
    held: Real
    instants: Real
