"""Constants and workspaces of eight copies at once: the same tables, with lanes in place of floats.

A lane workspace is used with constants that all copies share, or with lane constants, in which each copy has its own
masses, lengths, stiffnesses and functions. Integers, which describe the structure of a scene, are shared in both cases.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from flexmb.jit.bundle import bundle
from flexmb.jit.lanes import LANE, LANES
from flexmb.jit.wide_arrays import in_lanes
from flexmb.tables.arrays import Constants, Workspace
from flexmb.tables.workspaces import ports_at_rest
from flexmb.typing import Real, Record


@bundle
class LaneWorkspace(Workspace):
    """The arrays that one evaluation of LANES copies writes."""

    numbers = LANE


@bundle
class LaneConstants(Constants):
    """The arrays that do not change in a run, of LANES copies of one structure."""

    numbers = LANE

    ground: Real  # (3,LANES) acceleration of the ground, World axes
    rest: Record  # (P,) PORT_STATE of the undeformed bodies


def lane_workspace(w: Workspace) -> LaneWorkspace:
    """A workspace for copies of a system with workspace w; one per thread."""
    return LaneWorkspace(**{field.name: in_lanes([getattr(w, field.name)] * LANES) for field in fields(w)})


def lane_constants(copies: Sequence[Constants]) -> LaneConstants:
    """The constants of LANES systems of one structure."""
    return LaneConstants(
        **{field.name: in_lanes([getattr(c, field.name) for c in copies]) for field in fields(copies[0])},
        ground=in_lanes([-c.gravity for c in copies]),
        rest=in_lanes([ports_at_rest(c) for c in copies]),
    )


def structural_difference(a: Constants, b: Constants) -> str | None:
    """The table and the entry in which two scenes differ other than in floats; None if there is no such difference."""
    for field in fields(a):
        one, other = getattr(a, field.name), getattr(b, field.name)
        if one.shape != other.shape:
            return f"{field.name}, which has {one.shape} entries in one and {other.shape} in the other"
        for name in one.dtype.names or ():
            if one.dtype[name].base.kind == "i" and not np.array_equal(one[name], other[name]):
                place = tuple(np.argwhere(one[name] != other[name])[0].tolist())
                return f"{field.name}[{', '.join(map(str, place[: one.ndim]))}].{name}"
    return None
