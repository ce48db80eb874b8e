"""The content of an animation: the drawing of each body, the motion of its markers, and angles of wheels."""

from __future__ import annotations

from typing import Any

import numpy as np

from crosscheck.judging.results import CaseResults, Result
from crosscheck.records.kinds import FILM
from flexmb.typing import Real
from flexmb.view.drawing import Drawing, DrawnWheel, carried_line, carried_wheel, carriers
from flexmb.view.store import Store


def animations(store: Store, case: CaseResults) -> list[dict[str, Any]]:
    """One animation for each variant: from its film, else from the markers that an engine recorded."""
    animated = []
    for variant in case.case.run.variants:
        info = case.case.variants[variant.name]
        films = [(case.get(variant.name, engine, FILM), info.film) for engine in variant.engines]
        mains = [(case.get(variant.name, engine), info.drawing) for engine in variant.engines]
        for result, drawing in (*films, *mains):
            if drawing is not None and drawing.lines and _drawable(result, drawing):
                animated.append(_animation(store, result, drawing))
                break
    return animated


def _animation(store: Store, result: Result, drawing: Drawing) -> dict[str, Any]:
    names = carriers(drawing)
    number = {name: i for i, name in enumerate(names)}
    return {
        "title": f"{result.variant}, by {result.engine}",
        "times": store.times(result.times),
        "markers": [
            {
                "name": name,
                "position": store.samples(result.values(f"marker:{name}.position")),
                "orientation": store.samples(result.values(f"marker:{name}.orientation")),
            }
            for name in names
        ],
        "lines": [carried_line(line, number) for line in drawing.lines],
        "wheels": [
            carried_wheel(wheel, number, store.samples(wheel_angle(result, wheel))) for wheel in drawing.wheels
        ],
        "trails": [number[name] for name in drawing.trails if name in number],
        "gravity": drawing.gravity,
    }


def wheel_angle(result: Result, wheel: DrawnWheel) -> Real:
    """Angle of a wheel relative to its marker (T,), rad, from the axial torque on it and its marker's motion.

    With J its axial inertia and a its axis: J (omega . a + spin) changes at the rate torque . a. If no torque
    is recorded, the spin is constant.
    """
    times = result.times
    torque, turning = f"wheel_load:{wheel.name}.torque", f"marker:{wheel.marker}.angular_velocity"
    spin = np.full(len(times), wheel.speed_rad_s)
    if torque in result.finest.channels and turning in result.finest.channels:
        axis = _turned(result.values(f"marker:{wheel.marker}.orientation"), np.array(wheel.axis))
        carried = np.sum(result.values(turning) * axis, axis=1)
        impulse = _integral(np.sum(result.values(torque) * axis, axis=1), times)
        spin = wheel.speed_rad_s + carried[0] - carried + impulse / wheel.axial_inertia_kg_m2
    return wheel.angle_rad + _integral(spin, times)


def _integral(values: Real, times: Real) -> Real:
    """Integral over time from the first sample to each (T,), by the trapezoidal rule."""
    areas = 0.5 * (values[1:] + values[:-1]) * np.diff(times)
    return np.concatenate([[0.0], np.cumsum(areas)])


def _turned(quaternions: Real, vector: Real) -> Real:
    """A vector turned by each quaternion (T,4), scalar first: (T,3)."""
    w, u = quaternions[:, :1], quaternions[:, 1:]
    across = 2.0 * np.cross(u, vector)
    return vector + w * across + np.cross(u, across)


def _drawable(result: Result, drawing: Drawing) -> bool:
    """Whether the result's last run stored all markers needed; a diverged run is drawn up to its end."""
    if not result.runs or result.finest.times is None:
        return False
    stored = result.finest.channels
    wanted = (f"marker:{name}.{part}" for name in carriers(drawing) for part in ("position", "orientation"))
    return all(name in stored for name in wanted)
