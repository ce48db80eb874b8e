"""Entry point of the unsplit recursion: accelerations with modes and hinge of each body eliminated together."""

import numpy as np

from flexmb.jain.loads import drive_loads
from flexmb.jain.unsplit import Joint, forward_dynamics
from flexmb.jit.kernel import kernel
from flexmb.motion.coordinates import load_state
from flexmb.tables.arrays import Constants
from flexmb.tables.status import OK


def joint(c: Constants) -> Joint:
    """The arrays of the unsplit recursion in addition to the workspace."""
    n, _, m = c.mfr.shape
    return Joint(np.zeros((n, m + 6, m + 6)), np.zeros((n, m + 6, 6)), np.zeros((n, m + 6)))


@kernel
def accelerations(t, y, c, w, x):
    """udot to w.speed.acceleration, drive loads to w.speed.drive; returns a status code."""
    load_state(t, y, c, w)
    status = forward_dynamics(c, w, x)
    if status == OK:
        drive_loads(c, w)
    return status
