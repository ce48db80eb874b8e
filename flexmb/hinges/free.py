"""Free: q = [position of O in O+ axes, quaternion], u = [angular velocity; velocity of O], both in O axes."""

from flexmb.hinges import attitude
from flexmb.hinges.kind import HingeKind, Item, Names, Reduced
from flexmb.jit.kernel import helper
from flexmb.scene.schema import Free
from flexmb.spatial.rotation import quaternion_matrix, quaternion_rate
from flexmb.spatial.scalar import sqrt
from flexmb.spatial.vector import add, cross, store3, times, times_t, vec3
from flexmb.tables.axes import RATES, TURNING


@helper
def _attitude(q, i):
    return quaternion_matrix(q[i + 3], q[i + 4], q[i + 5], q[i + 6])


@helper
def pose(q, i, sequence, parameters):
    return _attitude(q, i), (q[i], q[i + 1], q[i + 2])


@helper
def motion(q, i, u, j, sequence, parameters, H):
    for n in range(6):
        H[n, n] = 1.0
    w = (u[j], u[j + 1], u[j + 2])
    v = (u[j + 3], u[j + 4], u[j + 5])
    # v is held in turning axes: seen from O+ it changes by w x v
    return (w, v), ((0.0, 0.0, 0.0), cross(w, v))


@helper
def rate(q, i, u, j, dq):
    """The quaternion enters the position rate normalised, so that scaling it scales only its own rate."""
    n2 = q[i + 3] * q[i + 3] + q[i + 4] * q[i + 4] + q[i + 5] * q[i + 5] + q[i + 6] * q[i + 6]
    s = 1.0 / sqrt(n2)
    r = quaternion_matrix(s * q[i + 3], s * q[i + 4], s * q[i + 5], s * q[i + 6])
    velocity = times(r, (u[j + 3], u[j + 4], u[j + 5]))
    for n in range(3):
        dq[i + n] = velocity[n]
    dw, dx, dy, dz = quaternion_rate(q[i + 3], q[i + 4], q[i + 5], q[i + 6], (u[j], u[j + 1], u[j + 2]))
    dq[i + 3] = dw
    dq[i + 4] = dx
    dq[i + 5] = dy
    dq[i + 6] = dz


@helper
def retract(q, i, increment, j, result):
    """On R3 x SO(3): a body that nothing pushes moves straight on, however it turns."""
    for n in range(3):
        result[i + n] = q[i + n] + increment[j + 3 + n]
    attitude.turn(q, i + 3, vec3(increment, j), result)


@helper
def resolve(q, i, u, x, j, how):
    """Velocities turn with the body; their rates as seen from O+ have w x v in addition."""
    R, v = _attitude(q, i), vec3(x, j + 3)
    if how == TURNING:
        store3(x, j + 3, times_t(R, v))
    else:
        store3(x, j + 3, times(R, add(v, cross(vec3(u, j), vec3(u, j + 3))) if how == RATES else v))


def reduced(item: Item) -> Reduced | None:
    """Free hinges."""
    return Reduced() if isinstance(item, Free) else None


def state(hinge: Free) -> tuple[list[float], list[float]]:
    """Position and quaternion, relative angular velocity and velocity."""
    return [*hinge.position_m, *hinge.quaternion], [*hinge.angular_velocity_rad_s, *hinge.velocity_m_s]


def names(hinge: Free) -> tuple[Names, Names]:
    """Of all these."""
    position = [(f"position.{axis}", "m") for axis in "xyz"]
    velocity = [(f"velocity.{axis}", "m/s") for axis in "xyz"]
    return position + attitude.QUATERNION, attitude.ANGULAR_VELOCITY + velocity


HINGE = HingeKind(
    name="free",
    coordinates=7,
    speeds=6,
    pose=pose,
    motion=motion,
    rate=rate,
    retract=retract,
    resolve=resolve,
    reduced=reduced,
    quaternion=3,
    displacements=(3, 4, 5),
    state=state,
    names=names,
)
