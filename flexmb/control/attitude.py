"""Attitude control laws of spacecraft, to be named in a scene, for example "flexmb.control.attitude:eigenaxis_slew".

They are kernels and not user functions (`flexmb.control.user`): their dependencies are known, so they can be cached.
"""

from __future__ import annotations

import math

from flexmb.jit.kernel import kernel


@kernel
def eigenaxis_slew(t, inputs, state, parameters, outputs, change):
    """Three torques in body axes that make a body follow a rotation profile about a fixed axis.

    inputs: its orientation to World (4, scalar first), its angular velocity in body axes (3), angle and rate of the
    profile (2). parameters: the axis (3, unit, body axes), stiffness k (3, N m/rad) and damping d (3, N m s/rad) about
    body axes. With the error quaternion q_e of the orientation against that of the profile and its angular velocity w,

        torque = -2 k sign(q_e0) (q_e1, q_e2, q_e3) - d (w - rate axis)

    A wheel motor uses the output with a gain of -1, since its torque on the wheel is opposite to that on the body.
    """
    w, x, y, z = inputs[0], inputs[1], inputs[2], inputs[3]
    angle, rate = inputs[7], inputs[8]
    c, s = math.cos(0.5 * angle), math.sin(0.5 * angle)
    a, b, d = -s * parameters[0], -s * parameters[1], -s * parameters[2]  # vector of the profile's conjugate
    scalar = c * w - a * x - b * y - d * z
    sign = 2.0 if scalar >= 0.0 else -2.0
    error = (c * x + a * w + b * z - d * y, c * y + b * w + d * x - a * z, c * z + d * w + a * y - b * x)
    for i in range(3):
        excess = inputs[4 + i] - rate * parameters[i]
        outputs[i] = -sign * parameters[3 + i] * error[i] - parameters[6 + i] * excess
