"""The memory of controllers at the end of a run, so that the run can be resumed there."""

from __future__ import annotations

from typing import NamedTuple

from flexmb.typing import Real


class LoopMemory(NamedTuple):
    """signal (S,) and state of all controllers, laid out as in `flexmb.control.tables.Loop`; held (rows,m): outputs of
    sampled controllers since t = 0; instants (1,): number of executed instants."""

    signal: Real
    state: Real
    held: Real
    instants: Real
