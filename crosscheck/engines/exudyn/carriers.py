"""Rigid frames and floating frames in an Exudyn system.

Every body keeps its own axes, chosen so that all bodies' axes are parallel to World where all hinge coordinates vanish
("Exudyn axes"): Exudyn measures a relative angle between the axes of two bodies, whatever the axes of the joint.
`zero` (3,3) maps scene body components to these axes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from crosscheck.engines.conventions import quaternion_of
from crosscheck.engines.exudyn.library import load, matrix
from crosscheck.engines.exudyn.modal import PointIntegrals, gravity_force
from crosscheck.engines.exudyn.motion import FrameMotion
from crosscheck.engines.exudyn.rotations import exponential, local_rate_map, turn_and_rate_map
from flexmb.scene.rigid_equivalent import Inertia, steiner
from flexmb.typing import Real


@dataclass(frozen=True)
class Carrier:
    """A body of the Exudyn system: `item` is the rigid body that markers attach to, `node` its rigid-body node.

    `inertia` is in Exudyn axes; a massless carrier has none. `flexible` is the floating frame object on the same node,
    `modes` the node of its modal coordinates, `data` its integrals. The ground has node -1.
    """

    item: int
    node: int
    zero: Real
    inertia: Inertia | None = None
    flexible: int | None = None
    modes: int | None = None
    data: PointIntegrals | None = None

    @property
    def key(self) -> int:
        """The node's number: -1 for the ground."""
        return int(self.node)


@dataclass
class Workshop:
    """An Exudyn system being built. `explicit`: Lie-group nodes, for the explicit integrator, not Euler parameters.

    Gravity acts on every carrier with mass as it is added.
    """

    gravity: Real
    explicit: bool
    exu: Any = field(init=False)
    items: Any = field(init=False)
    container: Any = field(init=False)
    mbs: Any = field(init=False)
    ground: Carrier = field(init=False)

    def __post_init__(self) -> None:
        self.exu = load()
        self.items = self.exu.itemInterface
        self.container = self.exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        self.ground = Carrier(self.mbs.AddObject(self.items.ObjectGround()), -1, np.eye(3))
        self.fixed_coordinate = self.mbs.AddMarker(
            self.items.MarkerNodeCoordinate(nodeNumber=self.mbs.AddNode(self.items.NodePointGround()), coordinate=0)
        )

    def rigid(self, motion: FrameMotion, zero: Real, inertia: Inertia | None) -> Carrier:
        """A rigid body, or a massless frame; `motion` of its scene frame, `inertia` in scene body axes."""
        node = self._node(motion, zero)
        if inertia is None:
            item = self.mbs.AddObject(self.items.ObjectRigidBody(nodeNumber=node, mass=0.0, inertia=[0.0] * 6))
            return Carrier(item, node, zero)
        own = Inertia(inertia.mass, zero @ inertia.com, zero @ inertia.inertia @ zero.T)
        about_origin = own.inertia + steiner(own.mass, own.com)
        item = self.mbs.AddObject(
            self.items.ObjectRigidBody(
                nodeNumber=node, mass=own.mass, inertia=_six(about_origin), centerOfMass=list(own.com)
            )
        )
        self.weigh(item)
        return Carrier(item, node, zero, own)

    def weigh(self, item: int) -> None:
        """Let gravity, if there is any, act on an object that has mass."""
        if self.gravity.any():
            marker = self.mbs.AddMarker(self.items.MarkerBodyMass(bodyNumber=item))
            self.mbs.AddLoad(self.items.LoadMassProportional(markerNumber=marker, loadVector=list(self.gravity)))

    def flexible(
        self, motion: FrameMotion, zero: Real, data: PointIntegrals, eta: Real, rate: Real, crosses: list[Real]
    ) -> Carrier:
        """A floating frame with modal coordinates, and a massless rigid body on the same node for joints to hold.

        `crosses`: rows [position (3,1), modes (3,m)] of massless mesh points for markers at deforming sections.
        """
        node = self._node(motion, zero)
        modes = self.mbs.AddNode(
            self.items.NodeGenericODE2(
                numberOfODE2Coordinates=len(eta), referenceCoordinates=[0.0] * len(eta),
                initialCoordinates=list(eta), initialCoordinates_t=list(rate),
            )
        )  # fmt: skip
        mesh = np.vstack(crosses)
        item = self.mbs.AddObject(
            self.items.ObjectFFRFreducedOrder(
                nodeNumbers=[node, modes],
                massMatrixReduced=matrix(data.modal), stiffnessMatrixReduced=matrix(data.stiffness),
                dampingMatrixReduced=matrix(data.damping) if data.damping.any() else [],
                modeBasis=mesh[:, 1:], referencePositions=mesh[:, 0],
                mass=data.mass, inertia=data.inertia, centerOfMass=data.first / data.mass,
                mPhitTPsi=data.shape, mPhitTPsiTilde=data.shape_cross, mXRefTildePsi=data.position_shape,
                mXRefTildePsiTilde=data.position_cross, mPsiTildePsi=data.cross_shape,
                mPsiTildePsiTilde=data.cross_cross, forceUserFunction=self._weight(data, node),
            )
        )  # fmt: skip
        held = item
        if not self.explicit:
            held = self.mbs.AddObject(self.items.ObjectRigidBody(nodeNumber=node, mass=0.0, inertia=[0.0] * 6))
        return Carrier(held, node, zero, None, item, modes, data)

    def marker(self, carrier: Carrier, position: Real, rotation: Real | None = None) -> int:
        """A marker at `position` on a carrier, its axes turned by `rotation` (both in Exudyn axes)."""
        turned = np.eye(3) if rotation is None else rotation
        frame = self.exu.HT(rotation=turned, translation=position)
        return self.mbs.AddMarker(self.items.MarkerBodyRigid(bodyNumber=carrier.item, localHT=frame))

    def angle_memory(self, angle: float) -> int:
        """A data node that continues an angle beyond half a turn, starting at `angle`."""
        return self.mbs.AddNode(
            self.items.NodeGenericData(initialCoordinates=[angle], numberOfDataCoordinates=1)
        )

    def _node(self, motion: FrameMotion, zero: Real) -> int:
        A = motion.rotation @ zero.T
        local = A.T @ motion.angular
        if self.explicit:
            turn = Rotation.from_matrix(A).as_rotvec()
            return self.mbs.AddNode(
                self.items.NodeRigidBodyRotVecLG(
                    referenceCoordinates=[0.0] * 6, initialCoordinates=[*motion.position, *turn],
                    initialVelocities=[*motion.linear, *local],
                )
            )  # fmt: skip
        p = quaternion_of(A)
        return self.mbs.AddNode(
            self.items.NodeRigidBodyEP(
                referenceCoordinates=[*motion.position, *p],
                initialVelocities=[*motion.linear, *(local_rate_map(p).T @ local / 4.0)],
            )
        )

    def _weight(self, data: PointIntegrals, node: int):
        """The user function with the weight of a flexible body, or 0 without gravity."""
        if not self.gravity.any():
            return 0
        g = self.gravity
        if self.explicit:

            def weight_on_group(mbs, t, item, q, qdot):
                turn = np.asarray(q[3:6])
                return gravity_force(data, g, exponential(turn), np.eye(3), np.asarray(q[6:]))

            return weight_on_group
        reference = np.array(self.mbs.GetNodeParameter(node, "referenceCoordinates"))[3:7]

        def weight(mbs, t, item, q, qdot):
            p = reference + q[3:7]
            return gravity_force(data, g, *turn_and_rate_map(p), np.asarray(q[7:]))

        return weight


def _six(J: Real) -> list[float]:
    """Exudyn's order [xx, yy, zz, yz, xz, xy] of a symmetric tensor."""
    return [J[0, 0], J[1, 1], J[2, 2], J[1, 2], J[0, 2], J[0, 1]]
