"""Modal masses that do not change with the deformation."""

from flexmb.jit.kernel import helper
from flexmb.jit.strips import put, strip, width


@helper
def modal_masses(c, w, k):
    """M_ff of body k at rest."""
    nm = c.body[k].modes
    for n in range(nm):
        for i in range(0, nm, width(w)):
            put(w, w.pff[k, n], i, strip(w, c.mff[k, n], i))
