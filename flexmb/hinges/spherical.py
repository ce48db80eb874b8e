"""Spherical: q = quaternion of O relative to O+ (scalar first), u = relative angular velocity in O axes."""

from flexmb.hinges import attitude
from flexmb.hinges.kind import HingeKind, Item, Names, Reduced
from flexmb.jit.kernel import helper
from flexmb.scene.schema import Spherical
from flexmb.spatial.rotation import quaternion_matrix, quaternion_rate


@helper
def pose(q, i, sequence, parameters):
    return quaternion_matrix(q[i], q[i + 1], q[i + 2], q[i + 3]), (0.0, 0.0, 0.0)


@helper
def motion(q, i, u, j, sequence, parameters, H):
    for n in range(3):
        H[n, n] = 1.0
    zero = (0.0, 0.0, 0.0)
    return ((u[j], u[j + 1], u[j + 2]), zero), (zero, zero)


@helper
def rate(q, i, u, j, dq):
    dw, dx, dy, dz = quaternion_rate(q[i], q[i + 1], q[i + 2], q[i + 3], (u[j], u[j + 1], u[j + 2]))
    dq[i] = dw
    dq[i + 1] = dx
    dq[i + 2] = dy
    dq[i + 3] = dz


@helper
def retract(q, i, increment, j, result):
    """Turned about carried axes by the exact exponential."""
    attitude.turn(q, i, (increment[j], increment[j + 1], increment[j + 2]), result)


def reduced(item: Item) -> Reduced | None:
    """Spherical hinges."""
    return Reduced() if isinstance(item, Spherical) else None


def state(hinge: Spherical) -> tuple[list[float], list[float]]:
    """Quaternion, relative angular velocity."""
    return [*hinge.quaternion], [*hinge.angular_velocity_rad_s]


def names(hinge: Spherical) -> tuple[Names, Names]:
    """Of both."""
    return attitude.QUATERNION, attitude.ANGULAR_VELOCITY


def ball(hinge: Spherical) -> tuple[float, float]:
    """Its isotropic spring and damper."""
    return hinge.stiffness_Nm_rad, hinge.damping_Nms_rad


HINGE = HingeKind(
    name="spherical",
    coordinates=4,
    speeds=3,
    pose=pose,
    motion=motion,
    rate=rate,
    retract=retract,
    reduced=reduced,
    quaternion=0,
    state=state,
    names=names,
    ball=ball,
)
