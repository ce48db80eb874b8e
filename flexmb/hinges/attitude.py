"""Common parts of hinges with a quaternion: names of coordinates and speeds, and finite turns."""

from flexmb.jit.kernel import helper
from flexmb.spatial.rotation import exponential_coefficients
from flexmb.spatial.vector import dot

QUATERNION = [(f"quaternion.{axis}", "1") for axis in "wxyz"]
ANGULAR_VELOCITY = [(f"angular_velocity.{axis}", "rad/s") for axis in "xyz"]


@helper
def turn(q, i, theta, result):
    """Quaternion at place i of `result` = that of q times (cos |theta|/2, sin |theta|/2 theta/|theta|)."""
    quarter = 0.25 * dot(theta, theta)
    k = exponential_coefficients(quarter)
    s, x, y, z = 1.0 - quarter * k[1], 0.5 * k[0] * theta[0], 0.5 * k[0] * theta[1], 0.5 * k[0] * theta[2]
    a, b, c, d = q[i], q[i + 1], q[i + 2], q[i + 3]
    result[i] = a * s - b * x - c * y - d * z
    result[i + 1] = a * x + b * s + c * z - d * y
    result[i + 2] = a * y - b * z + c * s + d * x
    result[i + 3] = a * z + b * y - c * x + d * s
