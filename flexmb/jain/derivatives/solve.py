"""M x = -T for many columns T at once, by the factors that `flexmb.jain.sweeps.inward` has left: (55), (56).

The columns are solved in blocks of strips. What passes from body to body is six numbers for each column, as in
`flexmb.jain.innovations`; in World axes they are added without a rotation. Bodies are visited depth first, so that
along a stretch of the tree these numbers stay in registers; only where the tree forks they are stored.
"""

from flexmb.jain.derivatives import solve_bodies
from flexmb.jain.derivatives.hinges import force_to_world
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.spatial.spatial_vector import store6, vec6
from flexmb.spatial.vector import mat3, vec3
from flexmb.tables.features import MODES, SEVERAL


@helper
def solve(c, w, d, columns):
    """Replace the first `columns` columns of `matrix` by -M^-1 times them; rows of prescribed speeds vanish."""
    _gains(c, w, d)
    for at in range(0, columns, solve_bodies.size(d)):
        solve_bodies.solve_block(c, w, d, at, c.body.shape[0])


@helper
def solve_with_inverse(c, w, d):
    """The same of all columns, of which the last third are those of -1; of the symmetric M^-1 the upper triangle.

    A force on a speed acts on no innovation but its own and those inboard, whose places are before its own.
    """
    _gains(c, w, d)
    nu, size = w.u.shape[0], solve_bodies.size(d)
    for at in range(0, 3 * nu, size):
        bodies = c.body.shape[0]
        if at >= 2 * nu:
            while d.places[d.order[bodies - 1]].hinge >= at + size - 2 * nu:
                bodies -= 1
        solve_bodies.solve_block(c, w, d, at, bodies)


@helper
def _gains(c, w, d):
    for k in range(c.body.shape[0]):
        _gains_of_hinge(c, w, d, k)
        if has(c, MODES):
            R, r = mat3(d.body[k].rotation, 0), vec3(d.body[k].position, 0)
            for n in range(c.body[k].modes):
                store6(d.gain[d.places[k].modes + n], 0, force_to_world(R, r, vec6(w.pfr[k, n], 0)))


@helper
def _gains_of_hinge(c, w, d, k):
    """G of single axes, and G L of other hinges, in World axes about the base point; pivots of single axes."""
    R, r = mat3(d.body[k].rotation, 0), vec3(d.body[k].position, 0)
    first = d.places[k].hinge
    if has(c, SEVERAL) and not solve_bodies.is_single(w, k):
        for a in range(w.body[k].free_count):
            place = first + w.hinge[k].free_speed[a]
            store6(d.gain[place], 0, force_to_world(R, r, vec6(w.hinge[k].gain[a], 0)))
            d.factor[place] = 1.0 / w.hinge[k].factor[a, a]
    else:
        store6(d.gain[first], 0, force_to_world(R, r, vec6(w.body[k].gain, 0)))
        d.factor[first] = 1.0 / w.body[k].inertia_along
