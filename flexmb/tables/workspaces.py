"""Workspaces of the recursion, of the sizes that a scene's constants ask for."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexmb.jit.lanes import LANES
from flexmb.tables import arrays as a
from flexmb.typing import Record


def workspace(c: a.Constants, nq: int, nu: int) -> a.Workspace:
    """Workspace of the right sizes; ports get their pose at rest, which is all that bodies without modes need."""
    n, m = c.mode.shape
    together = -(-n // LANES) * LANES
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
        "mode": np.zeros((n, m), a.MODE_STATE),
        "pff": np.zeros((n, m, m)),
        "port": ports_at_rest(c),
        "port_mode": np.zeros((len(c.port), m), a.COLUMN),
        "point_mode": np.zeros(m, a.COLUMN),
        "integral": np.zeros(12 * m),
        "speed": np.zeros(nu, a.SPEED_STATE),
        "function": np.zeros((len(c.function), 3)),
        "fault": np.zeros(1, np.int64),
        "doubt": np.zeros(1, np.int64),
        "displaced": np.ones(1, np.int64),
    }
    return _reduced(c, fields) if isinstance(c, a.ReducedConstants) else a.Workspace(**fields)


def ports_at_rest(c: a.Constants) -> Record:
    """(P,) PORT_STATE of the undeformed bodies."""
    port = np.zeros(len(c.port), a.PORT_STATE)
    port["r"] = c.port["position"] + c.port["offset"]
    port["R"] = c.port["frame"]
    return port


def _reduced(c: a.ReducedConstants, fields: dict[str, Any]) -> a.ReducedWorkspace:
    """With the tables at rest, which is all that ruthless bodies need."""
    node = np.zeros(c.node.shape, a.NODE_STATE)
    node["theta"] = c.node["theta"]
    return a.ReducedWorkspace(
        **fields,
        gain=c.gain.copy(),
        node=node,
        root=c.root.copy(),
        rank=c.rank.copy(),
        zeta=c.zeta.copy(),
        scratch=np.zeros((3, *c.root.shape[1:])),
    )
