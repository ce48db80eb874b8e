"""Connectors in Exudyn: its own springs where it has them, with the scene's laws as user functions; bushings as forces.

Exudyn's bushing (`RigidBodySpringDamper`) is not the scene's, whatever its user function returns: it acts with equal
and opposite forces at two points and leaves out their moment; its intrinsic formulation acts midway, and keeps the
moment to a thousandth only. A bushing is therefore a generalised force on the coordinates of what it joins.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from crosscheck.engines.connections import Along, Moving, exerts, tension_of
from crosscheck.engines.conventions import Frame, cross
from crosscheck.engines.exudyn.carriers import Carrier, Workshop
from crosscheck.engines.exudyn.joints import HingePort, Stage
from crosscheck.engines.exudyn.motion import initial
from crosscheck.engines.exudyn.rotations import turn_and_rate_map
from flexmb.scene.connectors import BetweenNodes, Bushing, SpringDamper
from flexmb.typing import Real


def between(shop: Workshop, connector: BetweenNodes, ports: Sequence[HingePort]) -> None:
    """A connector between the ports of its frames A and B."""
    if isinstance(connector, Bushing):
        _bushing(shop, connector, ports)
    else:
        _line(shop, connector, ports)


def along(shop: Workshop, stage: Stage, load: Callable[[float, float], Along]) -> int:
    """A load along the coordinate of a joint, by its value and rate; returns Exudyn's object."""
    if stage.angular:
        spring = shop.items.TorsionalSpringDamper(
            markerNumbers=list(stage.markers), nodeNumber=shop.angle_memory(initial(stage.coordinate)[0]),
            springTorqueUserFunction=lambda mbs, t, item, q, v, k, d, rest: -load(q, v).load,
        )  # fmt: skip
    else:
        spring = shop.items.LinearSpringDamper(
            markerNumbers=list(stage.markers),
            springForceUserFunction=lambda mbs, t, item, q, v, k, d, rest: -load(q, v).load,
        )
    return shop.mbs.AddObject(spring)


def _line(shop: Workshop, connector: SpringDamper, ports: Sequence[HingePort]) -> None:
    tension = tension_of(connector)
    shop.mbs.AddObject(
        shop.items.SpringDamper(
            markerNumbers=[shop.marker(port.carrier, port.position) for port in ports],
            referenceLength=connector.free_length_m, stiffness=0.0, damping=0.0,
            springForceUserFunction=lambda mbs, t, item, x, rate, k, d, f: tension(t, x, rate).load,
        )
    )  # fmt: skip


def _bushing(shop: Workshop, connector: Bushing, ports: Sequence[HingePort]) -> None:
    law = exerts(connector)
    ends = [_End(shop, port) for port in ports]
    nodes = sorted({end.node for end in ends if end.node >= 0})
    places = {node: slice(7 * i, 7 * i + 7) for i, node in enumerate(nodes)}

    def force(mbs, t, item, q, qdot):
        q, qdot, total = np.asarray(q), np.asarray(qdot), np.zeros(7 * len(nodes))
        for end in ends:
            if end.node >= 0:
                end.take(q[places[end.node]], qdot[places[end.node]])
        found = law(t, *(end.motion for end in ends))
        for end, wrench in zip(ends, (found.on_a, found.on_b), strict=True):
            if end.node >= 0:
                total[places[end.node]] += end.generalised(wrench)
        return total

    shop.mbs.AddObject(shop.items.ObjectGenericODE2(nodeNumbers=nodes, forceUserFunction=force))


class _End:
    """A frame of a bushing: its motion, and the generalised force of a wrench on it, by the coordinates of its node."""

    def __init__(self, shop: Workshop, port: HingePort) -> None:
        self.node = port.carrier.key
        self._frame = Frame(port.position, port.zero)
        self._rest = _reference(shop, port.carrier)
        still = Moving(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))
        self.motion = still.carrying(self._frame)

    def take(self, q: Real, qdot: Real) -> None:
        """Displacements and velocities (7,) of the node, position before Euler parameters."""
        here = self._rest + q
        self._turn, self._rate_map = turn_and_rate_map(here[3:])
        angular = self._turn @ (self._rate_map @ qdot[3:])
        self.motion = Moving(here[:3], self._turn, angular, qdot[:3]).carrying(self._frame)

    def generalised(self, wrench: Real) -> Real:
        """(7,) of [torque; force] (6,) about the frame's origin, in World axes."""
        torque = wrench[:3] + cross(self._turn @ self._frame.position, wrench[3:])
        return np.concatenate([wrench[3:], self._rate_map.T @ (self._turn.T @ torque)])


def _reference(shop: Workshop, carrier: Carrier) -> Real:
    """(7,) reference coordinates of a carrier's node; zeros for the ground, which has none."""
    if carrier.key < 0:
        return np.zeros(7)
    return np.array(shop.mbs.GetNodeParameter(carrier.node, "referenceCoordinates"))
