"""Level ruthless (Jain & Rodriguez, Appendix B): M_m at eta = 0, b_m at eta = etadot = 0."""

from flexmb.jit.kernel import helper
from flexmb.levels import rigid
from flexmb.levels.level import FidelityLevel
from flexmb.levels.masses import modal_masses
from flexmb.spatial.vector import dot, sym6, sym_times, vec3


@helper
def inertia_and_bias(c, w, k):
    """The rigid body at rest shape, constant modal blocks, and the centrifugal force w' B_n w on each mode."""
    rigid_block_and_bias(c, w, k)
    modal_masses(c, w, k)
    for n in range(c.body[k].modes):
        for i in range(6):
            w.mode[k, n].pfr[i] = c.mode[k, n].mfr[i]


@helper
def rigid_block_and_bias(c, w, k):
    """The same without the modal blocks of M_m, for callers that do not need them."""
    rigid.inertia_and_bias(c, w, k)
    omega = vec3(w.body[k].velocity, 0)
    for n in range(c.body[k].modes):
        w.mode[k, n].zf = dot(omega, sym_times(sym6(c.mode[k, n].gyration, 0), omega))


LEVEL = FidelityLevel(
    name="ruthless",
    inertia_and_bias=inertia_and_bias,
    without_masses=rigid_block_and_bias,
    tables=rigid.tables,
    cost=1.0,
    at_rest=True,
)
