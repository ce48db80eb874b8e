"""Constraint loads, from the suppressed rows and the last partition of (111) once the accelerations are known.

Row block k of (112) and of (115) is the momentum balance of the nest of body k: its left-hand side minus eta is the
total torque and force that hinge k-1 transmits, phi^c + phi^H and F^c + F^H. Likewise the row of a wheel gives
phi^c_W + CL (113).
"""

from flexmb.frisch.reduction import expanded_accelerations
from flexmb.jit.kernel import helper
from flexmb.spatial.vector import cross, store3, sub, vec3


@helper
def constraint_loads(c, w):
    """Loads (6,) across all hinges about outboard hinge points (112), (115), torques on wheels (113); World axes."""
    expanded_accelerations(c, w)
    bodies = c.body.shape[0]
    hinges = w.y.shape[0] - 3 * bodies
    for k in range(bodies):
        force = vec3(w.y, hinges + 3 * k)
        torque = sub(vec3(w.y, 3 * k), cross(vec3(w.nest[k].hinge_point, 0), force))
        store3(w.nest[k].load, 0, torque)
        store3(w.nest[k].load, 3, force)
    for i in range(c.wheel.shape[0]):
        store3(w.wheel[i].torque, 0, vec3(w.y, 3 * bodies + 3 * i))
