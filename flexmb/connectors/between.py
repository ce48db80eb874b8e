"""Connectors between two frames: dispatch by kind, and sums of energy and power."""

from flexmb.connectors.bushings import load_of_bushing
from flexmb.connectors.line import load_along_line
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.tables.arrays import BUSHING
from flexmb.tables.features import BUSHINGS


@helper
def load_between(c, w, i, A, B):
    """Write the load of connector i on B about B to w.connector[i].

    A and B are (position, rotation, velocity) of the two frames, World axes.
    """
    if has(c, BUSHINGS) and c.connector[i].kind == BUSHING:
        load_of_bushing(c, w, i, A, B)
    else:
        load_along_line(c, w, i, A, B)


@helper
def stored_in_connectors(w):
    """Energy in J at the last evaluation."""
    total = 0.0
    for i in range(w.connector.shape[0]):
        total += w.connector[i].energy
    return total


@helper
def connector_power(w):
    """Power in W of dampers and actuators at the last evaluation."""
    total = 0.0
    for i in range(w.connector.shape[0]):
        total += w.connector[i].power
    return total
