"""A fast check of the numbers of a state from outside (0.2 us)."""

import math

from flexmb.jit.kernel import helper, kernel

SOUND, NOT_FINITE, NO_ORIENTATION = range(3)
SHORTEST, LONGEST = 1e-200, 1e200  # admissible squares of a quaternion's length, before it is scaled to unit length


@helper
def soundness(values, quaternions):
    """SOUND, or the reason why numbers (n,) are invalid; `quaternions` (k,): the index at which each starts."""
    for i in range(values.shape[0]):
        if not math.isfinite(values[i]):
            return NOT_FINITE
    for k in range(quaternions.shape[0]):
        i = quaternions[k]
        q0, q1, q2, q3 = values[i], values[i + 1], values[i + 2], values[i + 3]
        norm2 = q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3  # powers would add a function to be compiled
        if not SHORTEST < norm2 < LONGEST:
            return NO_ORIENTATION
    return SOUND


@kernel
def unsound(values, quaternions):
    """`soundness` for callers in Python."""
    return soundness(values, quaternions)
