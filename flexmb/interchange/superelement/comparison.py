"""Frequencies and mode shapes of a reduced body beside those of the structure that it was made from."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.interchange.superelement.element import SuperElement
from flexmb.interchange.superelement.reduction import ReducedBody, all_modes, displacements
from flexmb.typing import Real

ALIKE = 1e-6
"""Relative difference of frequencies up to which modes of the structure are taken as a group, whose shapes can be any
of their combinations."""
BEYOND = 6  # modes of the structure above those that are asked for, in case a reduced one is in another order


class SideBySide(NamedTuple):
    """By mode of the body: its frequency, that of the structure's mode like it (Hz), and their MAC, from 0 to 1.

    The modal assurance criterion (a' M b)² / (a' M a · b' M b) says how alike two shapes are.
    """

    reduced: Real
    given: Real
    mac: Real


def compared(element: SuperElement, made: ReducedBody, count: int) -> SideBySide:
    """The lowest `count` modes of a body beside those of the structure with the same ties and boundary."""
    frequencies, modes = all_modes(element, made.interface, made.body.boundary, count + BEYOND)
    V = displacements(element, made.shapes)[:, :count]
    share = (V.T @ element.M @ modes) ** 2
    share /= np.outer(np.einsum("im,ij,jm->m", V, element.M, V), np.einsum("im,ij,jm->m", modes, element.M, modes))
    groups = np.abs(frequencies[:, None] - frequencies) <= ALIKE * frequencies
    share = share @ groups
    best = np.argmax(share, axis=1)
    return SideBySide(made.frequencies[:count], frequencies[best], share[np.arange(len(best)), best])
