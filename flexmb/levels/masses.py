"""Modal masses that do not change with the deformation."""

from flexmb.jit.kernel import helper


@helper
def modal_masses(c, w, k):
    """M_ff of body k at rest."""
    for n in range(c.body[k].modes):
        for i in range(c.body[k].modes):
            w.pff[k, n, i] = c.pair[k, n, i].mff
