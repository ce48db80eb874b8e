"""Nests: sums over all bodies outboard of a hinge point, (78)-(84), (107), (108), computed in one inward pass.

The sums over S_{k-1} of mass, m gamma, Phi + G and the right-hand sides follow from those of the nests one hinge
further out, shifted by beta. This costs O(N) operations; the print's double sums cost O(N^2).
"""

from flexmb.frisch.bodies import body_terms, load_terms, steiner, store_sym6, wheel_terms
from flexmb.frisch.connected import connector_terms
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.spatial.vector import add, add3, axpy, cross, store3, sym6, sym_add, sym_axpy, vec3
from flexmb.tables.features import CONNECTORS


@helper
def nest_sums(c, w):
    """All sums of (107)-(110) over the bodies of each nest, and the right-hand sides eta of (111)."""
    for k in range(c.body.shape[0]):
        body_terms(c, w, k)
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            wheel_terms(c, w, k, i)
        for i in range(c.body[k].load_start, c.body[k].load_stop):
            load_terms(c, w, k, i)
    if has(c, CONNECTORS):
        connector_terms(c, w)
    for k in range(c.body.shape[0] - 1, -1, -1):
        if c.body[k].parent >= 0:
            _join_nest(w, k, c.body[k].parent)
    _right_sides(c, w)


@helper
def _join_nest(w, k, p):
    """Add the sums of the nest of body k to those of its parent p, with moments about the parent's hinge point."""
    inner, outer = w.nest[p], w.nest[k]
    beta, first, mass = vec3(outer.beta, 0), vec3(outer.first, 0), outer.mass
    shifted = sym_add(sym6(outer.inertia, 0), sym_axpy(mass, steiner(beta, beta), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    shifted = sym_axpy(2.0, steiner(first, beta), shifted)
    store_sym6(inner.inertia, 0, sym_add(sym6(inner.inertia, 0), shifted))
    add3(inner.first, 0, axpy(mass, beta, first))
    inner.mass += mass
    force = vec3(outer.force, 0)
    add3(inner.force, 0, force)
    add3(inner.torque, 0, add(vec3(outer.torque, 0), cross(beta, force)))


@helper
def _right_sides(c, w):
    """eta_1 .. eta_4 of (111), the right-hand sides of (112)-(115), in the order of the expanded velocities."""
    bodies, wheels = c.body.shape[0], c.wheel.shape[0]
    hinges = w.eta.shape[0] - 3 * bodies
    for k in range(bodies):
        store3(w.eta, 3 * k, vec3(w.nest[k].torque, 0))
        store3(w.eta, hinges + 3 * k, vec3(w.nest[k].force, 0))
        for n in range(c.body[k].modes):
            w.eta[c.element[k].mode_row + n] = w.mode[k, n].row
    for i in range(wheels):
        rate = w.wheel[i].rate
        store3(w.eta, 3 * bodies + 3 * i, (-rate[0], -rate[1], -rate[2]))
