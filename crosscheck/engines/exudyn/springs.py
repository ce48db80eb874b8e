"""Connectors in Exudyn: its own springs with the scene's laws as user functions where possible, else forces.

Exudyn's bushing (`RigidBodySpringDamper`) differs from the scene's: it acts with equal
and opposite forces at two points and omits their moment; its intrinsic formulation acts midway and conserves the
moment only to 1e-3. Its markers on bending sections are not workless. Bushings, and lines from nodes that
deform, are therefore generalised forces on the coordinates of the joined bodies.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from crosscheck.engines.connections import Along, Moving, exerts, tension_of
from crosscheck.engines.conventions import Frame, cross
from crosscheck.engines.exudyn.carriers import Carrier, Workshop
from crosscheck.engines.exudyn.joints import Stage
from crosscheck.engines.exudyn.modal import NodeShape
from crosscheck.engines.exudyn.motion import FrameMotion
from crosscheck.engines.exudyn.rotations import left_jacobian, turn_and_rate_map
from crosscheck.engines.functions_of_time import initial
from flexmb.scene.connectors import BetweenNodes, SpringDamper
from flexmb.typing import Real


@dataclass(frozen=True)
class ConnectorEnd:
    """Frame A or B of a connector: `own` in the axes of a node of `carrier`, the node's `shape` in Exudyn axes."""

    carrier: Carrier
    shape: NodeShape
    own: Frame


def between(shop: Workshop, connector: BetweenNodes, ends: Sequence[ConnectorEnd]) -> None:
    if isinstance(connector, SpringDamper) and not any(end.shape.deforms for end in ends):
        _line(shop, connector, ends)
    else:
        _force(shop, connector, ends)


def along(shop: Workshop, stage: Stage, load: Callable[[float, float, float], Along]) -> int:
    """A load along the coordinate of a joint, by time, value and rate; returns Exudyn's object."""
    if stage.angular:
        spring = shop.items.TorsionalSpringDamper(
            markerNumbers=list(stage.markers), nodeNumber=shop.angle_memory(initial(stage.coordinate)[0]),
            springTorqueUserFunction=lambda mbs, t, item, q, v, k, d, rest: -load(t, q, v).load,
        )  # fmt: skip
    else:
        spring = shop.items.LinearSpringDamper(
            markerNumbers=list(stage.markers),
            springForceUserFunction=lambda mbs, t, item, q, v, k, d, rest: -load(t, q, v).load,
        )
    return shop.mbs.AddObject(spring)


def _line(shop: Workshop, connector: SpringDamper, ends: Sequence[ConnectorEnd]) -> None:
    tension = tension_of(connector)
    points = [end.shape.position + end.shape.rotation @ end.own.position for end in ends]
    shop.mbs.AddObject(
        shop.items.SpringDamper(
            markerNumbers=[shop.marker(end.carrier, point) for end, point in zip(ends, points, strict=True)],
            referenceLength=connector.free_length_m, stiffness=0.0, damping=0.0,
            springForceUserFunction=lambda mbs, t, item, x, rate, k, d, f: tension(t, x, rate).load,
        )
    )  # fmt: skip


def _force(shop: Workshop, connector: BetweenNodes, ends: Sequence[ConnectorEnd]) -> None:
    law = exerts(connector)
    held = [_Held(shop, end) for end in ends]
    sizes = {node: size for side in held for node, size in side.nodes.items()}
    starts = np.cumsum([0, *sizes.values()])
    places = {node: slice(starts[i], starts[i + 1]) for i, node in enumerate(sizes)}

    def force(mbs, t, item, q, qdot):
        q, qdot, total = np.asarray(q), np.asarray(qdot), np.zeros(starts[-1])
        for side in held:
            side.take(*([values[places[node]] for node in side.nodes] for values in (q, qdot)))
        found = law(t, *(side.motion for side in held))
        for side, wrench in zip(held, (found.on_a, found.on_b), strict=True):
            for node, share in zip(side.nodes, side.generalised(wrench), strict=True):
                total[places[node]] += share
        return total

    shop.mbs.AddObject(shop.items.ObjectGenericODE2(nodeNumbers=list(sizes), forceUserFunction=force))


class _Held:
    """The carrier of a connector's end: its motion from the coordinates of its nodes, and generalised forces of a
    wrench.

    `nodes`: number and count of coordinates of the frame's node, and of the node of modal coordinates where it bends.
    """

    def __init__(self, shop: Workshop, end: ConnectorEnd) -> None:
        carrier, modes = end.carrier, end.shape.translation.shape[1]
        self._end, self._rest, self.nodes = end, np.zeros(7), {}
        self._body = FrameMotion(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))
        if carrier.key >= 0:
            self.nodes = {carrier.node: 7} | ({carrier.modes: modes} if carrier.modes is not None else {})
            self._rest = np.array(shop.mbs.GetNodeParameter(carrier.node, "referenceCoordinates"))
        self._follow(np.zeros(modes), np.zeros(modes))

    def take(self, q: list[Real], qdot: list[Real]) -> None:
        """Displacements and velocities of each of the nodes; of the frame's, positions before Euler parameters."""
        if not self.nodes:
            return
        here = self._rest + q[0]
        turn, self._rate_map = turn_and_rate_map(here[3:])
        self._body = FrameMotion(here[:3], turn, turn @ (self._rate_map @ qdot[0][3:]), qdot[0][:3])
        none = np.zeros(self._end.shape.translation.shape[1])
        self._follow(*(values[1] if len(values) > 1 else none for values in (q, qdot)))

    def generalised(self, wrench: Real) -> list[Real]:
        """Forces on the coordinates of each node, of [torque; force] (6,) about the end's origin, in World axes."""
        if not self.nodes:
            return []
        turn, force, shape = self._body.rotation, wrench[3:], self._end.shape
        about_body, about_node = (
            wrench[:3] + cross(self.motion.position - point, force)
            for point in (self._body.position, self._node.position)
        )
        on_frame = np.concatenate([force, self._rate_map.T @ (turn.T @ about_body)])
        if len(self.nodes) == 1:
            return [on_frame]
        turning = left_jacobian(shape.rotation_modes @ self._eta) @ shape.rotation_modes
        return [on_frame, shape.translation.T @ (turn.T @ force) + turning.T @ (turn.T @ about_node)]

    def _follow(self, eta: Real, rate: Real) -> None:
        shape, self._eta = self._end.shape, eta
        if shape.deforms:
            self._node = self._body.node(shape, eta, rate)
        else:
            self._node = self._body.offset(shape.position, shape.rotation)
        end = self._node.offset(self._end.own.position, self._end.own.rotation)
        self.motion = Moving(end.position, end.rotation, end.angular, end.linear)
