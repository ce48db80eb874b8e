"""Modes that follow those of the same beam with other numbers, so that they depend smoothly on these numbers.

The eigenproblem determines a mode up to its sign, and modes of equal frequency up to an orthogonal matrix; their order
is that of the frequencies. All three may jump where a number of the beam changes by nothing. Here signs and order are
those of a reference. Modes whose frequencies are nearly equal in the reference are taken together: of all orthonormal
bases of their space the one nearest to the modes of the reference is taken, in the metric of the mass matrix (the
orthogonal Procrustes problem: Golub & Van Loan, Matrix Computations, 4th ed., 6.4.1). That basis is as smooth as the
space, while the eigenmodes themselves turn quickly, or have no derivatives. Planes of bending that nothing couples each
keep their own modes, because their spaces are orthogonal.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexmb.modal.reduce import BeamModes
from flexmb.typing import Real

# Relative difference of the squared frequencies below which modes are taken together. Derivatives of single
# eigenvectors grow with its inverse, and their rounding errors with its square.
REPEATED = 1e-2
# Least cosine of the angle between the space of modes and that of the reference: others are not the same modes.
SAME = 0.7


def followed(modes: BeamModes, M: Real, reference: BeamModes) -> BeamModes:
    """The same modes with the order, the signs and, of repeated frequencies, the basis of the reference.

    M (size,size): mass matrix of the beam. Raises ValueError where they are not the modes of the reference, slightly
    changed.
    """
    if modes.columns.shape != reference.columns.shape:
        raise ValueError("its modes or finite elements change their number")
    overlap = modes.columns.T @ (M @ reference.columns)
    turn = np.zeros_like(overlap)
    for group in _repeated(reference.frequencies):
        shares = np.sum(overlap[:, group] ** 2, axis=1)
        chosen = np.sort(np.argsort(-shares, kind="stable")[: len(group)])
        U, cosines, Vt = np.linalg.svd(overlap[np.ix_(chosen, group)])
        if not np.min(cosines) > SAME * np.linalg.norm(overlap[:, group], 2):
            raise ValueError(
                f"mode {group[0]} at {reference.frequencies[group[0]]:.6g} rad/s is not found again when the number "
                "changes slightly: its frequency is that of another mode, which may be one that is left out"
            )
        turn[np.ix_(chosen, group)] = U @ Vt
    if not np.allclose(turn.T @ turn, np.eye(len(turn))):
        raise ValueError("two modes become the same one when the number changes slightly: their frequencies cross")
    return replace(modes, columns=modes.columns @ turn, turn=turn)


def _repeated(frequencies: Real) -> list[list[int]]:
    """The modes in groups of nearly equal frequency, in ascending order."""
    groups = [[0]] if len(frequencies) else []
    for n in range(1, len(frequencies)):
        before, now = frequencies[n - 1] ** 2, frequencies[n] ** 2
        if now - before > REPEATED * now:
            groups.append([])
        groups[-1].append(n)
    return groups
