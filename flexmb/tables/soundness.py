"""A check whether numbers from outside can be used, which takes a fifth of a microsecond."""

import math

from flexmb.jit.kernel import helper, kernel

SOUND, NOT_FINITE, NO_ORIENTATION = range(3)
SHORTEST, LONGEST = 1e-200, 1e200  # squares of lengths that a quaternion may have: it is scaled to unit length


@helper
def soundness(values, quaternions):
    """SOUND, or why numbers (n,) cannot be used; `quaternions` (k,): where each starts among them."""
    for i in range(values.shape[0]):
        if not math.isfinite(values[i]):
            return NOT_FINITE
    for k in range(quaternions.shape[0]):
        i = quaternions[k]
        q0, q1, q2, q3 = values[i], values[i + 1], values[i + 2], values[i + 3]
        norm2 = q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3  # a power would be a function of numba's to compile first
        if not SHORTEST < norm2 < LONGEST:
            return NO_ORIENTATION
    return SOUND


@kernel
def unsound(values, quaternions):
    """The same for callers in Python."""
    return soundness(values, quaternions)
