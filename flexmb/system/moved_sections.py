"""Motion of the sections of beams of level exact, for arrays in NumPy; `flexmb.modal.strain_field` has the equations.

All are analytic functions of the modal coordinates and their rates, which may be complex.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.modal.strain_field import FIRST, MEAN, SECOND, STRETCH, StrainField
from flexmb.system.turning_points import turning
from flexmb.typing import Real


class MovedSections(NamedTuple):
    """Position r, velocity v, acceleration a (n,3), rotation R (n,3,3) from the sections at rest, angular velocity
    omega and acceleration alpha (n,3) of n sections, relative to the body, in its axes."""

    r: Real
    v: Real
    a: Real
    R: Real
    omega: Real
    alpha: Real


def moved_sections(field: StrainField, eta: Real, etad: Real, etadd: Real) -> MovedSections:
    """The sections at modal coordinates (m,) with their first two rates."""
    (k1, k2, mean, g), (d1, d2, mean_rate, g_rate), (a1, a2, mean_again, g_again) = (
        [field.rows[:, row] @ x for row in (FIRST, SECOND, MEAN, STRETCH)] for x in (eta, etad, etadd)
    )
    s = field.commutator[:, None]
    step, spin, spin_rate = turning(
        mean + s * np.cross(k1, k2),
        mean_rate + s * (np.cross(d1, k2) + np.cross(k1, d2)),
        mean_again + s * (np.cross(a1, k2) + 2.0 * np.cross(d1, d2) + np.cross(k1, a2)),
    )
    R, omega, alpha = np.empty_like(step), np.empty_like(spin), np.empty_like(spin)
    for j, i in enumerate(field.before):
        if i < 0:
            R[j], omega[j], alpha[j] = step[j], spin[j], spin_rate[j]
            continue
        more = R[i] @ spin[j]
        R[j], omega[j] = R[i] @ step[j], omega[i] + more
        alpha[j] = alpha[i] + np.cross(omega[i], more) + R[i] @ spin_rate[j]
    at, at_rest = field.gauss, field.tangent[field.gauss]
    w = omega[at]
    tangent, stretching, again = (
        np.einsum("nab,nb->na", R[at], each) for each in (at_rest + g[at], g_rate[at], g_again[at])
    )
    turned = np.cross(w, tangent)
    bent = np.cross(alpha[at], tangent) + np.cross(w, turned + 2.0 * stretching) + again
    return MovedSections(
        r=field.position + field.weight @ (tangent - at_rest),
        v=field.weight @ (turned + stretching),
        a=field.weight @ bent,
        R=R,
        omega=omega,
        alpha=alpha,
    )
