"""Constraint loads: they follow from the suppressed rows of (111) and its last partition, given the accelerations.

Row block k of (112) and of (115) is the balance of the nest of body k: left side minus eta is the whole torque and
force that hinge k-1 transmits, phi^c + phi^H and F^c + F^H; likewise the row of a wheel, phi^c_W + CL (113).
"""

from flexmb.frisch.reduction import expanded_accelerations
from flexmb.jit.kernel import helper
from flexmb.spatial.vector import cross, store3, sub, vec3


@helper
def constraint_loads(c, w):
    """Load (6,) across every hinge about its outboard hinge point (112), (115), torque of wheels (113), World axes."""
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
