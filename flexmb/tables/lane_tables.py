"""Constants and workspaces of eight copies at once: the same tables, whose floats are lanes.

A workspace of lanes goes with constants that all copies share, or with constants of lanes, where each copy has masses,
lengths, stiffnesses and functions of its own. Integers, which say what a scene consists of, are shared in either case.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from flexmb.jit.bundle import bundle
from flexmb.jit.lane_arrays import in_lanes
from flexmb.jit.lanes import LANES
from flexmb.tables.arrays import Constants, Workspace
from flexmb.typing import Real, Record


@bundle
class LaneWorkspace(Workspace):
    """What one evaluation of LANES copies writes."""

    in_lanes = True


@bundle
class LaneConstants(Constants):
    """Everything that does not change in a run, of LANES copies of one structure."""

    in_lanes = True

    ground: Real  # (3,LANES) acceleration of the ground, World axes
    rest: Record  # (P,) PORT_STATE of the undeformed bodies


def lane_workspace(w: Workspace) -> LaneWorkspace:
    """For copies of a system with workspace w; one per thread."""
    return LaneWorkspace(**{field.name: in_lanes([getattr(w, field.name)] * LANES) for field in fields(w)})


def lane_constants(copies: Sequence[tuple[Constants, Workspace]]) -> LaneConstants:
    """Of LANES systems of one structure, each with its constants and a fresh workspace."""
    constants, workspaces = [c for c, _ in copies], [w for _, w in copies]
    return LaneConstants(
        **{field.name: in_lanes([getattr(c, field.name) for c in constants]) for field in fields(constants[0])},
        ground=in_lanes([w.ground for w in workspaces]),
        rest=in_lanes([w.port for w in workspaces]),
    )


def structural_difference(a: Constants, b: Constants) -> str | None:
    """Where two scenes differ in more than floats: the table's field and its place; None where they do not."""
    for field in fields(a):
        one, other = getattr(a, field.name), getattr(b, field.name)
        if one.shape != other.shape:
            return f"{field.name}, which has {one.shape} entries in one and {other.shape} in the other"
        for name in one.dtype.names or ():
            if one.dtype[name].base.kind == "i" and not np.array_equal(one[name], other[name]):
                place = tuple(np.argwhere(one[name] != other[name])[0].tolist())
                return f"{field.name}[{', '.join(map(str, place[: one.ndim]))}].{name}"
    return None
