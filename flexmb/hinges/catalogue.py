"""The hinge kinds by number, and the dispatch that the sweeps call."""

from flexmb.hinges import (
    cylindrical,
    free,
    gimbal2,
    gimbal3,
    planar,
    prismatic,
    revolute,
    spherical,
    translation2,
    translation3,
    weld,
)
from flexmb.jit.kernel import helper

WELD, REVOLUTE, PRISMATIC, CYLINDRICAL, GIMBAL2, GIMBAL3, SPHERICAL, PLANAR, TRANSLATION2, TRANSLATION3, FREE = range(
    11
)

KINDS = {
    WELD: weld,
    REVOLUTE: revolute,
    PRISMATIC: prismatic,
    CYLINDRICAL: cylindrical,
    GIMBAL2: gimbal2,
    GIMBAL3: gimbal3,
    SPHERICAL: spherical,
    PLANAR: planar,
    TRANSLATION2: translation2,
    TRANSLATION3: translation3,
    FREE: free,
}


@helper
def pose(kind, q, i, sequence):
    """Relative pose (R, p) of hinge `kind`; see `flexmb.hinges`."""
    if kind == REVOLUTE:
        return revolute.pose(q, i, sequence)
    if kind == PRISMATIC:
        return prismatic.pose(q, i, sequence)
    if kind == CYLINDRICAL:
        return cylindrical.pose(q, i, sequence)
    if kind == GIMBAL2:
        return gimbal2.pose(q, i, sequence)
    if kind == GIMBAL3:
        return gimbal3.pose(q, i, sequence)
    if kind == SPHERICAL:
        return spherical.pose(q, i, sequence)
    if kind == PLANAR:
        return planar.pose(q, i, sequence)
    if kind == TRANSLATION2:
        return translation2.pose(q, i, sequence)
    if kind == TRANSLATION3:
        return translation3.pose(q, i, sequence)
    if kind == FREE:
        return free.pose(q, i, sequence)
    return weld.pose(q, i, sequence)


@helper
def motion(kind, q, i, u, j, sequence, H):
    """Hinge map into H and (w, v, alpha, a) of hinge `kind`; see `flexmb.hinges`."""
    if kind == REVOLUTE:
        return revolute.motion(q, i, u, j, sequence, H)
    if kind == PRISMATIC:
        return prismatic.motion(q, i, u, j, sequence, H)
    if kind == CYLINDRICAL:
        return cylindrical.motion(q, i, u, j, sequence, H)
    if kind == GIMBAL2:
        return gimbal2.motion(q, i, u, j, sequence, H)
    if kind == GIMBAL3:
        return gimbal3.motion(q, i, u, j, sequence, H)
    if kind == SPHERICAL:
        return spherical.motion(q, i, u, j, sequence, H)
    if kind == PLANAR:
        return planar.motion(q, i, u, j, sequence, H)
    if kind == TRANSLATION2:
        return translation2.motion(q, i, u, j, sequence, H)
    if kind == TRANSLATION3:
        return translation3.motion(q, i, u, j, sequence, H)
    if kind == FREE:
        return free.motion(q, i, u, j, sequence, H)
    return weld.motion(q, i, u, j, sequence, H)


@helper
def rate(kind, q, i, u, j, sequence, dq):
    """Configuration rate of hinge `kind` into dq; see `flexmb.hinges`."""
    if kind == SPHERICAL:
        spherical.rate(q, i, u, j, sequence, dq)
    elif kind == FREE:
        free.rate(q, i, u, j, sequence, dq)
    elif kind in (REVOLUTE, PRISMATIC):
        revolute.rate(q, i, u, j, sequence, dq)
    elif kind == CYLINDRICAL:
        cylindrical.rate(q, i, u, j, sequence, dq)
    elif kind == GIMBAL2:
        gimbal2.rate(q, i, u, j, sequence, dq)
    elif kind == GIMBAL3:
        gimbal3.rate(q, i, u, j, sequence, dq)
    elif kind == PLANAR:
        planar.rate(q, i, u, j, sequence, dq)
    elif kind == TRANSLATION2:
        translation2.rate(q, i, u, j, sequence, dq)
    elif kind == TRANSLATION3:
        translation3.rate(q, i, u, j, sequence, dq)


@helper
def quaternion_offset(kind):
    """Where the quaternion of a hinge begins among its coordinates; -1 where it has none."""
    if kind == SPHERICAL:
        return 0
    if kind == FREE:
        return 3
    return -1
