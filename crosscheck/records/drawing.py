"""What is drawn of a scene: lines between points that markers carry, as records hold it."""

from __future__ import annotations

import msgspec

from flexmb.scene.bodies import Vector


class CarriedPoint(msgspec.Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A marker ("" is the World origin) and an offset in its axes (m)."""

    marker: str
    offset: Vector


class Line(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A polyline of one body; `kind` chooses its style."""

    body: str
    kind: str
    points: tuple[CarriedPoint, ...]


class Drawing(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """All lines of a scene, and the markers that are worth a trail."""

    lines: tuple[Line, ...]
    trails: tuple[str, ...]
