"""The drawing of a scene as data: lines, solids and wheels that move with markers."""

from __future__ import annotations

from typing import Any

import msgspec

from flexmb.scene.bodies import ZERO, Vector


class CarriedPoint(msgspec.Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """A marker ("" is the World origin) and an offset in its axes (m); `tangent`, a unit vector in its axes, is the
    direction of a bent line there, zero if unknown."""

    marker: str
    offset: Vector
    tangent: Vector = ZERO


class Line(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The drawing of one body or connector, which `body` names; `kind` is the meaning of its points.

    "solid": the eight corners of a box, the first coordinate's sign changing slowest. "arm": a straight line. "beam": a
    line through its points that bends with their tangents. "ball": a point with mass. "spring": a coil between its two
    points. "mount": a mark at each of its points, the frames of a bushing or the hinge of a spring. Records of older
    versions have "box", one edge of a box, and "wheel", a rim: straight lines both. "sheet": a surface of triangles
    between its points, whose numbers `faces` has. `across`, `widths`: at each point of a beam the direction of the
    section's y in its marker's axes, and the widths (m) of the section along y and z; none for a line without sections.
    """

    body: str
    kind: str
    points: tuple[CarriedPoint, ...]
    across: tuple[Vector, ...] = ()
    widths: tuple[tuple[float, float], ...] = ()
    faces: tuple[tuple[int, int, int], ...] = ()


class DrawnWheel(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A disc on a marker (centre and unit axis in its axes), with the data that determine its angle.

    The angle is relative to the marker: `angle_rad` at t = 0, where its rate is `speed_rad_s`; later the axial torque
    on the wheel changes its axial rate in World, with `axial_inertia_kg_m2`.
    """

    name: str
    marker: str
    centre: Vector
    axis: Vector
    radius_m: float
    width_m: float
    axial_inertia_kg_m2: float
    speed_rad_s: float
    angle_rad: float


class Drawing(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The drawing of a scene, the markers whose trails are drawn, and the direction of gravity (zero without)."""

    lines: tuple[Line, ...]
    trails: tuple[str, ...]
    wheels: tuple[DrawnWheel, ...] = ()
    gravity: Vector = ZERO


def carriers(drawing: Drawing) -> list[str]:
    """Markers that carry something or leave a trail, each once."""
    carrying = [point.marker for line in drawing.lines for point in line.points if point.marker]
    return list(dict.fromkeys((*carrying, *(wheel.marker for wheel in drawing.wheels), *drawing.trails)))


# What page/scene.js reads: `number` has the places of markers in its list, and -1 stands for the World.


def carried_point(point: CarriedPoint, number: dict[str, int]) -> list[float]:
    """[marker, offset, tangent]."""
    return [number.get(point.marker, -1), *point.offset, *point.tangent]


def carried_line(line: Line, number: dict[str, int]) -> dict[str, Any]:
    """A line with its points."""
    drawn = {"body": line.body, "kind": line.kind, "points": [carried_point(point, number) for point in line.points]}
    more = {"across": line.across, "widths": line.widths, "faces": line.faces}
    return drawn | {key: value for key, value in more.items() if value}


def carried_wheel(wheel: DrawnWheel, number: dict[str, int], angle: int) -> dict[str, Any]:
    """A wheel; `angle` is the number of the series of its angle relative to the marker (rad)."""
    return {
        "name": wheel.name,
        "marker": number[wheel.marker],
        "centre": wheel.centre,
        "axis": wheel.axis,
        "radius": wheel.radius_m,
        "width": wheel.width_m,
        "angle": angle,
    }
