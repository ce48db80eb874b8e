"""Level ruthless (Jain & Rodriguez, Appendix B): M_m at eta = 0, b_m at eta = etadot = 0."""

from flexmb.jit.kernel import helper
from flexmb.jit.strips import put, put_across, width
from flexmb.levels import rigid
from flexmb.levels.level import FidelityLevel
from flexmb.levels.masses import modal_masses
from flexmb.spatial.rows import strips6
from flexmb.spatial.spatial_vector import dot6
from flexmb.spatial.vector import vec3


@helper
def inertia_and_bias(c, w, k):
    """Jain & Rodriguez (B1): the rigid body at rest shape, constant modal blocks, w' B_n w on each mode."""
    rigid_block_and_bias(c, w, k)
    modal_masses(c, w, k)
    for n in range(0, c.body[k].modes, width(w)):
        put_across(w, w.pfr[k], n, strips6(w, c.mfr[k], n))


@helper
def rigid_block_and_bias(c, w, k):
    """`inertia_and_bias` without the modal blocks of M_m."""
    rigid.inertia_and_bias(c, w, k)
    omega = vec3(w.body[k].velocity, 0)
    spin = omega[0] * omega[0], omega[1] * omega[1], omega[2] * omega[2]
    across = 2.0 * omega[0] * omega[1], 2.0 * omega[0] * omega[2], 2.0 * omega[1] * omega[2]
    for n in range(0, c.body[k].modes, width(w)):
        put(w, w.zf[k], n, dot6((spin, across), strips6(w, c.gyration[k], n)))


LEVEL = FidelityLevel(
    name="ruthless",
    inertia_and_bias=inertia_and_bias,
    without_masses=rigid_block_and_bias,
    tables=rigid.tables,
    cost=1.0,
    at_rest=True,
)
