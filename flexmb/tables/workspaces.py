"""Workspaces of the recursion, sized for the constants of a scene."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexmb.jit.lanes import LANES
from flexmb.jit.strips import ROW, strip_zeros
from flexmb.tables import arrays as a
from flexmb.typing import Record


def workspace(c: a.Constants, nq: int, nu: int) -> a.Workspace:
    """A workspace of the right sizes; ports have their poses at rest, which are final for bodies without modes."""
    n, _, m = c.mfr.shape
    together, tangents = -(-n // LANES) * LANES, int(np.max(c.body["gauss_points"], initial=0))
    fields: dict[str, Any] = {
        "q": np.zeros(nq),
        "u": np.zeros(nu),
        "raw": np.zeros(nq),
        "rate": np.zeros(nq),
        "ground": -c.gravity,
        "angle": np.zeros(together),
        "sine": np.zeros(together),
        "cosine": np.zeros(together),
        "body": np.zeros(n, a.BODY_STATE),
        "hinge": np.zeros(n, a.HINGE_STATE),
        **{name: strip_zeros((n, m)) for name in ("eta", "etad", "etadd", "zf", "inverse_pivot")},
        "pff": strip_zeros((n, m, m)),
        "pfr": strip_zeros((n, m, ROW)),
        "port": ports_at_rest(c),
        "port_mode": strip_zeros((len(c.port), 6, m)),
        "point_mode": strip_zeros((6, max(m, ROW))),  # at least one strip: eliminations store their sums there
        "section": np.zeros(len(c.section), a.SECTION_STATE),
        "section_mode": strip_zeros((len(c.section), 6, m)),
        "tangent": np.zeros(tangents, a.TANGENT_STATE),
        "tangent_mode": strip_zeros((tangents, 3, m)),
        "speed": np.zeros(nu, a.SPEED_STATE),
        **connector_states(c),
        "function": np.zeros((len(c.function), 3)),
        "fault": np.zeros(1, np.int64),
        "doubt": np.zeros(1, np.int64),
        "displaced": np.ones(1, np.int64),
    }
    return _reduced(c, fields) if isinstance(c, a.ReducedConstants) else a.Workspace(**fields)


def connector_states(c: a.Constants) -> dict[str, Record]:
    """The arrays that an evaluation of connectors writes."""
    return {
        "connector": np.zeros(len(c.connector), a.CONNECTOR_STATE),
        "hinge_spring": np.zeros(len(c.hinge_spring), a.ALONG_HINGE_STATE),
        "coordinate_law": np.zeros(len(c.coordinate_law), a.ALONG_HINGE_STATE),
    }


def ports_at_rest(c: a.Constants) -> Record:
    """(P,) PORT_STATE of the undeformed bodies."""
    port = np.zeros(len(c.port), a.PORT_STATE)
    port["r"] = c.port["position"] + c.port["offset"]
    port["R"] = c.port["frame"]
    return port


def _reduced(c: a.ReducedConstants, fields: dict[str, Any]) -> a.ReducedWorkspace:
    """A workspace with reduced bodies; its tables are those at rest, which are final for ruthless bodies."""
    node, gain = np.zeros(c.node.shape, a.NODE_STATE), strip_zeros(c.gain.shape)
    gain[:] = c.gain
    node["theta"] = c.node["theta"]
    return a.ReducedWorkspace(
        **fields,
        gain=gain,
        node=node,
        root=c.root.copy(),
        rank=c.rank.copy(),
        zeta=c.zeta.copy(),
        scratch=np.zeros((3, *c.root.shape[1:])),
    )
