"""The force of each body's own inertia, and how it changes."""

from flexmb.jain.derivatives.flexible import flexible_force
from flexmb.jain.derivatives.rigid import rigid_force
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.tables.features import CONNECTORS, LOADS, MODES


@helper
def own_force(c, w, d, k):
    """Inertia, `by_rate` and force of body k alone."""
    if has(c, LOADS) or has(c, CONNECTORS):
        for i in range(18):
            d.body[k].by_turn[i] = 0.0
    if has(c, MODES) and c.body[k].modes > 0:
        flexible_force(c, w, d, k)
    else:
        rigid_force(c, d, k)
