"""Level rigid: no modes. T = 1/2 m v.v + v.(w x s) + 1/2 w.J w."""

from flexmb.jit.kernel import helper
from flexmb.spatial.inertia import rigid_inertia, store_inertia
from flexmb.spatial.vector import cross, store3, sym6, sym_times, vec3


@helper
def inertia_and_bias(c, w, k):
    """Newton-Euler about the body origin: torque w x J w, force w x (w x s)."""
    body = c.body[k].rigid
    s = vec3(body, 1)
    j = sym6(body, 4)
    omega = vec3(w.body[k].velocity, 0)
    store_inertia(w.body[k].inertia, 0, rigid_inertia(body[0], s, j))
    store3(w.body[k].force, 0, cross(omega, sym_times(j, omega)))
    store3(w.body[k].force, 3, cross(omega, cross(omega, s)))
