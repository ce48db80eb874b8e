"""Constants of Frisch's equations from the links of a scene: parameters of bodies, indices of the sparse matrix S."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import fields, replace

import numpy as np

from flexmb.building.links import BodyLink
from flexmb.frisch import tables as t
from flexmb.frisch.errata import Erratum
from flexmb.frisch.parameters import ModeParameters, mode_parameters
from flexmb.tables import arrays as a

_SIX = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
_SWITCHES = (
    Erratum.ONE_SIDED, Erratum.NO_LOADS_ON_MODES, Erratum.FIXED_SPIN_AXIS, Erratum.FIXED_SHAPES, Erratum.SECOND_ORDER,
)  # fmt: skip


def nested_constants(
    constants: a.Constants, chain: list[BodyLink], errata: Set[Erratum], null_partitions: bool = False
) -> t.NestedConstants:
    """The scene's constants and the tables of Frisch's equations, in which the defects `errata` of the print are kept.

    The partitions phiR_H, phiT_H, phiR_W vanish for hinges and wheels at nodes that do not deform. They have no entries
    in S, unless `null_partitions` keeps those for which the constants have ports.

    Raises ValueError if a body is of level stiffened or exact, or if any defect is kept and the modes of a body are not
    clamped at its origin.
    """
    parameters = [_parameters(link, errata) for link in chain]
    element, mode, pair, slopes = _elements(parameters, constants.mff.shape[2])
    column, rows, wheel_entry = _places(constants, element, null_partitions)
    return t.NestedConstants(
        **{field.name: getattr(constants, field.name) for field in fields(constants)},
        element=element,
        element_mode=mode,
        element_pair=pair,
        M1_slope=slopes,
        wheel_entry=wheel_entry,
        column=column,
        entry_row=rows,
        printed=np.array([erratum in errata for erratum in _SWITCHES], np.int64),
    )


def _parameters(link: BodyLink, errata: Set[Erratum]) -> ModeParameters:
    """(48)-(72) of one body; the tensors of its despun wheels are left to I_W (26), their masses are elements."""
    model = link.model
    if link.level.second_order:
        raise ValueError(
            f'body "{link.name}": these equations are of first order in the deformation and have no geometric '
            'stiffness, which level "stiffened" needs; use level "linear" or "full", or algorithm "articulated"'
        )
    first_wheel = len(model.mass) - link.wheels
    if link.level.by_strain:
        raise ValueError(
            f'body "{link.name}": these equations are of first order in the deformation, and level "exact" is of no '
            'finite order; use level "linear" or "full", or algorithm "articulated"'
        )
    inertia = np.where((np.arange(len(model.mass)) < first_wheel)[:, None, None], model.inertia, 0.0)
    model = replace(model, inertia=inertia)
    corrected = mode_parameters(model)
    if not errata:
        return corrected
    if link.outboard.deforms:
        raise ValueError(
            f'body "{link.name}": its inboard hinge sits on a node that its modes move, but the print clamps every '
            'body at its hinge point; use clamped modes, or algorithm "frisch"'
        )
    printed = mode_parameters(model, as_printed=True)
    if Erratum.INERTIA_SLOPE in errata:
        corrected = replace(corrected, E=printed.E)
    if Erratum.ROTARY_CORIOLIS in errata:
        corrected = replace(corrected, K=printed.K)
    if Erratum.DROPPED_DEFORMATION in errata:
        corrected = replace(corrected, F=printed.F, A1=printed.A1, Q1=printed.Q1, M1_slope=printed.M1_slope)
    return corrected


def _elements(parameters: list[ModeParameters], m: int) -> tuple[a.Record, a.Record, a.Record, a.Real]:
    """The parameters of all bodies as tables; m is the largest number of modes."""
    bodies = len(parameters)
    element = np.zeros(bodies, t.ELEMENTS)
    mode, pair = np.zeros((bodies, m), t.ELEMENT_MODE), np.zeros((bodies, m, m), t.ELEMENT_PAIR)
    slopes: list[a.Real] = []
    for k, p in enumerate(parameters):
        n = p.mode_count
        element["mass"][k], element["alpha"][k], element["Phi"][k] = p.mass, p.alpha, _six(p.Phi)
        element["slope"][k] = -1
        if np.any(p.M1_slope):
            element["slope"][k] = len(slopes)
            slopes.append(np.pad(p.M1_slope, [(0, m - n)] * 3))
        mode["A"][k, :n], mode["Q"][k, :n] = p.A, p.Q
        mode["E"][k, :n], mode["H"][k, :n] = _six(p.E), _six(p.H)
        pair["M1"][k, :n, :n], pair["F"][k, :n, :n], pair["K"][k, :n, :n] = p.M1, _six(p.F), p.K
        pair["A1"][k, :n, :n], pair["Q1"][k, :n, :n] = p.A1, p.Q1
    return element, mode, pair, np.array(slopes).reshape(len(slopes), m, m, m)


def _six(tensors: a.Real) -> a.Real:
    """xx, yy, zz, xy, xz, yz of the symmetric parts, over the leading axes."""
    return np.stack([0.5 * (tensors[..., i, j] + tensors[..., j, i]) for i, j in _SIX], axis=-1)


def _places(
    c: a.Constants, element: a.Record, null_partitions: bool
) -> tuple[a.Record, a.Index, a.Index]:
    """Columns of S, the expanded row of each entry, and `wheel_entry`; completes `element`.

    The column of a hinge or wheel speed has the rows of its own relative motion. The column of a mode has the mode's
    own row, then the rows of every relative motion that the mode causes: of the body itself if its hinge sits on a
    deforming node, of hinges on its deforming nodes, and of its wheels.
    """
    bodies, wheels = len(c.body), len(c.wheel)
    modes = int(np.sum(c.body["modes"]))
    hinges = 3 * bodies + 3 * wheels + modes
    element["mode_row"] = 3 * bodies + 3 * wheels + np.cumsum(c.body["modes"]) - c.body["modes"]
    element["inboard_entry"] = element["outboard_entry"] = -1
    wheel_entry = np.full(wheels, -1, np.int64)
    own: dict[int, list[int]] = {}
    modal: dict[int, list[int]] = {}
    body_of = np.zeros(len(c.speed), np.int64)

    def relative_rows(k: int) -> list[int]:
        return [*range(3 * k, 3 * k + 3), *range(hinges + 3 * k, hinges + 3 * k + 3)]

    for k in range(bodies):
        body = c.body[k]
        for j in range(body["u_index"], body["u_index"] + body["nv"]):
            own[j], modal[j], body_of[j] = relative_rows(k), [], k
        moved = relative_rows(k) if body["outboard_port"] >= 0 else []
        element["outboard_entry"][k] = 1 if moved else -1
        for child in range(k + 1, bodies):
            if c.body["parent"][child] == k and c.body["inboard_port"][child] >= 0:
                element["inboard_entry"][child] = 1 + len(moved)
                moved = moved + relative_rows(child)
        for i in range(body["wheel_start"], body["wheel_stop"]):
            wheel_rows = [*range(3 * bodies + 3 * i, 3 * bodies + 3 * i + 3)]
            own[int(c.wheel["u_index"][i])], modal[int(c.wheel["u_index"][i])] = wheel_rows, []
            body_of[c.wheel["u_index"][i]] = k
            turns = null_partitions or np.any(c.port_mode[c.wheel["port"][i], :3])
            wheel_entry[i] = 1 + len(moved) if turns else -1
            moved = moved + (wheel_rows if turns else [])
        for n in range(body["modes"]):
            j = int(body["etad_index"]) + n
            own[j], modal[j], body_of[j] = [int(element["mode_row"][k]) + n], moved, k
    column, rows = np.zeros(len(c.speed), t.SPEED_COLUMN), list[int]()
    for j in range(len(c.speed)):
        start = len(rows)
        rows += [*own[j], *modal[j]]
        column[j] = (start, start + len(own[j]), len(rows), body_of[j])
    return column, np.array(rows, np.int64), wheel_entry
