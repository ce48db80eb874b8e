"""The tables of the sections of beams of level exact, for `flexmb.levels.section_motion`."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexmb.building.links import BodyLink, Port
from flexmb.jit.strips import strip_zeros
from flexmb.levels.section_motion import ANGLE
from flexmb.modal.strain_field import STRETCH, WHOLE, StrainField
from flexmb.tables import arrays as a
from flexmb.typing import Index, Real


def section_arrays(
    chain: list[BodyLink], ports: list[list[Port]], body: a.Record, point: a.Record, port: a.Record, m: int
) -> dict[str, Any]:
    """The tables of all sections that carry inertia or a port; writes their numbers to `body`, `point` and `port`.

    `point` has the number of a section among those of its body; -1 for none. `ports`: those of each body, in the order
    of `port`.
    """
    point_section, port_section = point["section"].copy(), np.full(len(port), -1)
    point["section"] = port["section"] = -1
    tables, weights, rows, count, first_port = [], [], [], 0, 0
    for k, link in enumerate(chain):
        own_ports = slice(first_port, first_port + len(ports[k]))
        first_port = own_ports.stop
        body["section_start"][k] = body["section_stop"][k] = count
        field = None if link.is_rigid else link.model.field
        if field is None:
            continue
        port_section[own_ports] = [port.node.section for port in ports[k]]
        own_points = slice(body["point_start"][k], body["point_stop"][k])
        number = _kept(field, np.concatenate([point_section[own_points], port_section[own_ports]]))
        table, weight, own_rows = _tables(field, number, count, body[k : k + 1], m)
        for record, own, found in ((point, own_points, point_section), (port, own_ports, port_section)):
            record["section"][own] = np.where(found[own] < 0, -1, count + number[found[own]])
        tables.append(table)
        weights.append(weight)
        rows.append(own_rows)
        count += len(table)
        body["section_stop"][k] = count
    most = max((weight.shape[1] for weight in weights), default=0)
    section_weight, section_rows = np.zeros((count, most)), strip_zeros((count, 12, m))
    start = 0
    for weight, own_rows in zip(weights, rows, strict=True):
        section_weight[start : start + len(weight), : weight.shape[1]] = weight
        section_rows[start : start + len(weight)] = own_rows
        start += len(weight)
    return {
        "section": np.concatenate([*tables, np.zeros(0, a.SECTION)]),
        "section_rows": section_rows,
        "section_weight": section_weight,
    }


def _kept(field: StrainField, used: Index) -> Index:
    """(n,) the new number of each section, -1 for those at nodes that are not used. None of these turns others."""
    kept = np.zeros(len(field.x), bool)
    kept[: field.steps] = True
    kept[used[used >= 0]] = True
    return np.where(kept, np.cumsum(kept) - 1, -1)


def _tables(field: StrainField, number: Index, first: int, body: a.Record, m: int) -> tuple[a.Record, Real, Real]:
    """SECTION records, weights and rows of the kept sections of one body, whose first has the number `first`."""
    kept = np.flatnonzero(number >= 0)
    table = np.zeros(len(kept), a.SECTION)
    table["before"] = np.where(field.before[kept] < 0, -1, first + number[field.before[kept]])
    table["gauss"] = -1
    table["gauss"][number[field.gauss]] = np.arange(len(field.gauss))
    base, own = field.base[kept], field.own[kept]
    table["base"] = np.where(base < 0, -1, first + number[base])
    table["own_start"], table["own_stop"] = own.T
    table["arm"] = field.position[kept] - np.where(base[:, None] < 0, 0.0, field.position[base])
    table["tangent"] = field.tangent[kept]
    rows = np.zeros((len(kept), 12, m))
    rows[..., : field.mode_count] = field.rows[kept].reshape(len(kept), 12, -1)
    axis = field.axis
    body["gauss_points"] = len(field.gauss)
    body["stretching"] = bool(np.any(field.rows[:, STRETCH]))
    body["planar"] = axis is not None
    if axis is not None:
        body["bending_axis"] = axis
        turn, _ = field.shapes()
        rows[:, 3 * WHOLE : 3 * STRETCH] = 0.0
        rows[:, ANGLE, : field.mode_count] = np.einsum("a,jam->jm", axis, turn[kept])
    weight = np.zeros((len(kept), int(np.max(own[:, 1] - own[:, 0]))))
    for j, (start, stop) in enumerate(own):
        weight[j, : stop - start] = field.weight[kept[j], start:stop]
    return table, weight, rows
