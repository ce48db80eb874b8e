"""Everything observable in dual numbers."""

from __future__ import annotations

from flexmb.entry.observation import Outputs, places
from flexmb.jit.bundle import bundle
from flexmb.jit.duals import DUAL
from flexmb.jit.wide_arrays import as_duals
from flexmb.typing import Real


@bundle
class OutputsTangent(Outputs):
    """Outputs whose numbers are duals."""

    numbers = DUAL


def outputs_tangent(out: Outputs, room: Real | None = None) -> OutputsTangent:
    """Dual outputs of the shapes and markers of `out`; one per thread. room (m,8): the memory of them all."""
    count = len(out.every)
    every, drives = (as_duals(out.every), as_duals(out.drives)) if room is None else (room[:count], room[count:])
    shapes = {name: getattr(out, name).shape for name in _PARTS}
    parts = {name: every[place].reshape(*shape, every.shape[-1]) for name, (place, shape) in places(shapes).items()}
    return OutputsTangent(marker_body=out.marker_body, marker_port=out.marker_port, drives=drives, every=every, **parts)


_PARTS = ("rates", "markers", "loads", "wheel_loads", "energy", "momentum", "connectors", "hinge_forces")
