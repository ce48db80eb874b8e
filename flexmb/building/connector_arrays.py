"""From connectors to the arrays of flexmb.tables.arrays: ends, springs, and the numbers of all other laws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from flexmb.building.links import BodyLink, Port, port
from flexmb.building.numbering import Numbering
from flexmb.connectors.catalogue import frame_law_of, law_of
from flexmb.scene import schema as s
from flexmb.scene.bodies import IDENTITY
from flexmb.scene.connectors import (
    AlongHinge,
    AngularSpring,
    BetweenNodes,
    HingeFriction,
    HingeSpring,
    actuator,
    by_stem,
    sticks,
)
from flexmb.scene.quaternions import rotation_matrix
from flexmb.scene.sticking import realised
from flexmb.scene.tree import GROUND, coordinate_of
from flexmb.tables import arrays as a
from flexmb.typing import Real

SMOOTHING = 1e-8  # the smoothing length of a spring, relative to its free length
SMALLEST_SMOOTHING = 1e-12  # m, for springs without free length
NO_STOP = 1e300  # a limit that no coordinate reaches
ACTS = {"both": a.BOTH, "tension": a.TENSION, "compression": a.COMPRESSION}

Rows = list[tuple[float, ...]]
Number = Callable[[s.Function | None], int]
"""Returns the number of a function of time, -1 for None."""


def between_nodes(scene: s.Scene) -> list[BetweenNodes]:
    """Connectors between two nodes, in the scene's order."""
    return [connector for connector in scene.connectors if isinstance(connector, BetweenNodes)]


def along_hinges(scene: s.Scene) -> tuple[list[AlongHinge], list[AlongHinge]]:
    """Connectors along hinges in the order of the tables: those in that of springs, and those in that of other laws.
    Friction that sticks is in both: see `flexmb.scene.sticking.realised`."""
    along = [connector for connector in scene.connectors if isinstance(connector, AlongHinge)]
    springs = [connector for connector in along if isinstance(connector, HingeSpring) or sticks(connector)]
    return springs, [connector for connector in along if not isinstance(connector, HingeSpring)]


def end_ports(scene: s.Scene, chain: list[BodyLink], index: dict[str, int]) -> list[tuple[int, Port] | None]:
    """(body, port) of sides A and B of the first connector, of the second ...; None on the ground.

    NotImplementedError where a body of level ruthless deforms at an end.
    """
    ports: list[tuple[int, Port] | None] = []
    for connector in between_nodes(scene):
        for side in "ab":
            body, node = getattr(connector, f"body_{side}"), getattr(connector, f"node_{side}")
            if body == GROUND:
                ports.append(None)
                continue
            link = chain[index[body]]
            at = port(link.node(node), *_offset(connector, side), np.eye(3))
            if link.level.at_rest and at.deforms:
                raise NotImplementedError(
                    f'connector "{connector.name}": loads act on body "{body}" of level "{link.level.name}" in its '
                    f'undeformed shape, so a spring at its node "{node}" would not respond to its deformation; use '
                    'level "linear" or "full"'
                )
            ports.append((index[body], at))
    return ports


def connector_arrays(
    scene: s.Scene, ends: list[tuple[int, int]], numbering: Numbering, number: Number
) -> dict[str, Any]:
    """The tables of connectors by their names in Constants.

    ends: (body, port) of sides A and B of each connector between two nodes, (-1, -1) on the ground.
    """
    laws: Rows = []
    connectors = between_nodes(scene)
    records, sides = np.zeros(len(connectors), a.CONNECTOR), np.zeros((len(connectors), 2), a.END)
    frame_laws: list[tuple[float, ...]] = []
    for i, connector in enumerate(connectors):
        record = records[i]
        record["function"] = record["row"] = -1
        for j, side in enumerate("ab"):
            sides[i, j]["body"], sides[i, j]["port"] = ends[2 * i + j]
            if sides[i, j]["body"] == a.ON_GROUND:
                offset, quaternion = _offset(connector, side)
                sides[i, j]["position"], sides[i, j]["rotation"] = offset, rotation_matrix(quaternion).ravel()
        record["kind"], parameters = frame_law_of(connector)
        if parameters:
            record["row"] = len(frame_laws)
            frame_laws.append(parameters)
        if isinstance(connector, s.SpringDamper):
            record["acts"] = ACTS[connector.acts]
            record["free_length"], record["damping"] = connector.free_length_m, connector.damping_Ns_m
            record["smoothing"] = max(SMOOTHING * connector.free_length_m, SMALLEST_SMOOTHING)
            record["function"] = number(connector.force_N)
            record["start"], record["stop"] = _add(laws, _pieces(by_stem(connector), connector.acts))
    springs, others = along_hinges(scene)
    return {
        "connector": records,
        "end": sides,
        "frame_law": _frame_laws(frame_laws),
        "hinge_spring": _hinge_springs(scene, springs, numbering, laws, number),
        "coordinate_law": _coordinate_laws(scene, others, numbering),
        "law": np.array(laws, float).reshape(-1, 8),
    }


def _frame_laws(parameters: Sequence[tuple[float, ...]]) -> a.Record:
    out = np.zeros(len(parameters), a.FRAME_LAW)
    for row, numbers in zip(out, parameters, strict=True):
        row["parameters"][: len(numbers)] = numbers
    return out


def _offset(connector: BetweenNodes, side: str) -> tuple[s.Vector, s.Quaternion]:
    """Position and orientation of frame A or B relative to its node."""
    return getattr(connector, f"position_{side}_m"), getattr(connector, f"quaternion_{side}", IDENTITY)


def _speed(scene: s.Scene, connector: AlongHinge, numbering: Numbering) -> int:
    item, place = coordinate_of(scene, connector)
    return numbering.u[item.name].start + place


def _hinge_springs(
    scene: s.Scene, springs: list[AlongHinge], numbering: Numbering, laws: Rows, number: Number
) -> a.Record:
    out = np.zeros(len(springs), a.HINGE_SPRING)
    for row, connector in zip(out, springs, strict=True):
        row["speed"] = _speed(scene, connector, numbering)
        spring = _actuating(connector) if isinstance(connector, HingeFriction) else connector
        law = by_stem(spring)
        row["start"], row["stop"] = _add(laws, _pieces(law))
        for name in ("rest", "damping", "stop_stiffness", "stop_dissipation"):
            row[name] = law[name]
        row["lower"] = -NO_STOP if law["lower"] is None else law["lower"]
        row["upper"] = NO_STOP if law["upper"] is None else law["upper"]
        row["function"] = number(actuator(spring))
    return out


def _actuating(connector: HingeFriction) -> AngularSpring:
    """A spring without stiffness, whose actuator is the constant part of friction that sticks."""
    return AngularSpring(name=connector.name, hinge=connector.hinge, torque_Nm=realised(connector).constant)


def _coordinate_laws(scene: s.Scene, connectors: Sequence[AlongHinge], numbering: Numbering) -> a.Record:
    out = np.zeros(len(connectors), a.COORDINATE_LAW)
    for row, connector in zip(out, connectors, strict=True):
        own = realised(connector).law if isinstance(connector, HingeFriction) and sticks(connector) else connector
        row["speed"], (row["kind"], numbers) = _speed(scene, connector, numbering), law_of(own)
        row["parameters"][: len(numbers)] = numbers
    return out


def _add(laws: Rows, pieces: Rows) -> tuple[int, int]:
    """Append the pieces of a law to the table of all laws, and return the range of their rows."""
    start = len(laws)
    laws += pieces
    return start, len(laws)


def _pieces(law: dict[str, Any], acts: str = "both") -> Rows:
    """Rows (8,) of a law: left end, energy there, coefficients, highest power first."""
    if law["table"]:
        return _through(np.array(law["table"]), np.array(law["loads"]))
    powers = (law["preload"], law["stiffness"], *law["stiffening"], 0.0, 0.0, 0.0, 0.0)[:6]
    if acts == "both":
        return [(0.0, 0.0, *powers[::-1])]
    slack = -law["preload"] / law["stiffness"]  # where the load would change its sign
    loaded, idle = (slack, 0.0, *powers[:0:-1], 0.0), (slack, *(0.0,) * 7)
    return [idle, loaded] if acts == "tension" else [loaded, idle]


def _through(x: Real, loads: Real) -> Rows:
    """Cubic pieces through samples, continued by their end slopes; no energy is stored at x = 0."""
    from scipy.interpolate import PchipInterpolator  # slow to import, and few scenes have tables of loads

    spline = PchipInterpolator(x, loads)
    energy = spline.antiderivative()
    slopes = spline.derivative()(x[[0, -1]])
    ends = [(x[0], energy(x[0]), loads[0], slopes[0]), (x[-1], energy(x[-1]), loads[-1], slopes[1])]
    (before, *_, after) = ([at, stored, 0.0, 0.0, 0.0, 0.0, slope, load] for at, stored, load, slope in ends)
    cubics = [[left, energy(left), 0.0, 0.0, *spline.c[:, i]] for i, left in enumerate(x[:-1])]
    rows = np.array([before, *cubics, after], float)
    at_zero = rows[max(0, int(np.searchsorted(rows[:, 0], 0.0, side="right")) - 1)]  # the piece that contains x = 0
    rows[:, 1] -= at_zero[1] + np.polyval(np.polyint(at_zero[2:]), -at_zero[0])
    return [tuple(row) for row in rows.tolist()]
