"""What springs between nodes do in an Exudyn run, from the recorded motion of their ends."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from crosscheck.engines.connections import Exerted, Moving, exerts
from crosscheck.engines.exudyn.assembly import Assembly
from crosscheck.engines.exudyn.markers import marker_path
from crosscheck.engines.exudyn.state import CarrierPath, States
from flexmb.scene.connectors import SpringDamper
from flexmb.scene.tree import GROUND
from flexmb.typing import Real

Paths = dict[int, CarrierPath]


def exerted(assembly: Assembly, states: States, paths: Paths) -> dict[str, list[Exerted]]:
    """What each connector does at every sample."""
    found = {}
    for connector in assembly.scene.connectors:
        assert isinstance(connector, SpringDamper)
        a, b = (_moving(assembly, connector, side, paths, len(states.times)) for side in "ab")
        law = exerts(connector)
        found[connector.name] = [law(t, *ends) for t, *ends in zip(states.times.tolist(), a, b, strict=True)]
    return found


def _moving(assembly: Assembly, connector: SpringDamper, side: str, paths: Paths, count: int) -> list[Moving]:
    """Motion of an end over all samples."""
    body, offset = getattr(connector, f"body_{side}"), np.array(getattr(connector, f"position_{side}_m"))
    if body == GROUND:
        return [Moving(offset, np.eye(3), np.zeros(3), np.zeros(3))] * count
    placed = assembly.bodies[body]
    path = marker_path(paths[placed.carrier.key], placed.shape(getattr(connector, f"node_{side}")), offset)
    turns: Real = Rotation.from_quat(path.quaternion, scalar_first=True).as_matrix()
    motion = zip(path.position, turns, path.velocity[:, :3], path.velocity[:, 3:], strict=True)
    return [Moving(*each) for each in motion]

