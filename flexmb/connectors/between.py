"""Connectors between two frames: dispatch by kind, and sums of energy and power."""

from flexmb.connectors.catalogue import load_between_frames
from flexmb.jit.kernel import helper


@helper
def load_between(c, w, i, A, B):
    """Write the load of connector i on B about B to w.connector[i].

    A and B are (position, rotation, velocity) of the two frames, World axes.
    """
    load_between_frames(c, c.connector[i].kind, c, w, i, A, B)


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
