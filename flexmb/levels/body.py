"""M_m and b_m of a body, whatever its level."""

from flexmb.jit.kernel import helper
from flexmb.levels import full, linear, rigid, ruthless, stiffened
from flexmb.tables.arrays import FULL, LINEAR, RUTHLESS, STIFFENED


@helper
def body_inertia(c, w, k):
    """M_m and b_m of body k at its level."""
    if c.body[k].level == FULL:
        full.inertia_and_bias(c, w, k)
    elif c.body[k].level == RUTHLESS:
        ruthless.inertia_and_bias(c, w, k)
    elif c.body[k].level == LINEAR:
        linear.inertia_and_bias(c, w, k)
    elif c.body[k].level == STIFFENED:
        stiffened.inertia_and_bias(c, w, k)
    else:
        rigid.inertia_and_bias(c, w, k)
