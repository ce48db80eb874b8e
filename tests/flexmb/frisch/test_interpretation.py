"""The paper's reading of its modal equation, (183)-(185): terms of rates of one mode, over elements again."""

from __future__ import annotations

import numpy as np
import pytest

from flexmb.frisch.parameters import mode_parameters
from flexmb.modal.flexible_model import FlexibleModel
from tests.bounds import gamma
from tests.flexmb.frisch import exact

BODIES = [exact.random_body(seed) for seed in range(3)] + [exact.random_body(3, particles=True)]


def over_elements(body: FlexibleModel, a, adot, w, path, frame_rate) -> np.ndarray:
    """Right side of (183) for every mode (n,): force (184) on its displacement, torque on its rotation.

    `path` is the centripetal and Coriolis acceleration of the hinge point, `frame_rate` what (185) adds theta' to.
    """
    total = np.zeros(body.mode_count)
    for i in range(len(body.mass)):
        c, phiR = body.com_offset[i], body.rotation[i].T
        phiT = body.translation[i].T + np.cross(phiR, c)
        r = body.position[i] + c + a @ phiT
        force = body.mass[i] * (path + np.cross(w, np.cross(w, r)) + 2.0 * np.cross(w, adot @ phiT))  # (184)
        torque = np.cross(w, body.inertia[i] @ (frame_rate + adot @ phiR))  # (185)
        total -= phiT @ force + phiR @ torque
    return total


@pytest.mark.parametrize(("body", "share"), list(zip(BODIES, [0.016, 0.145, 0.071, 0.0], strict=True)))
def test_terms_of_rates_over_elements(body, share):
    """(183), (185): the torque on an element is w x J (w + theta'); the print's w x J theta' misses w.J_n.w.

    That is the given share of the largest modal force of the rates.
    """
    a, adot = np.random.default_rng(8).normal(size=(2, body.mode_count))
    w, path = np.random.default_rng(9).normal(size=(2, 3))
    p = mode_parameters(body, as_printed=True)
    H = p.H + np.einsum("mnab,m->nab", p.F, a)
    terms = -p.mass * p.A @ (path + np.cross(w, np.cross(w, p.alpha)))
    terms += np.einsum("a,nab,b->n", w, H, w) - 2.0 * np.einsum("a,m,mna->n", w, adot, p.K)
    missing = np.einsum("a,nab,b->n", w, p.J, w)
    # Both sides are sums over the elements of terms of at most ten factors, of the size of what the masses see.
    size = (np.abs(p.H).sum() + np.abs(p.F).sum() + np.abs(p.K).sum() + p.mass * np.abs(p.A).sum()) * 10.0
    rounding = gamma(20 + len(body.mass)) * size * (1.0 + w @ w)
    assert np.max(np.abs(terms - over_elements(body, a, adot, w, path, frame_rate=w))) <= rounding
    printed = over_elements(body, a, adot, w, path, frame_rate=np.zeros(3))
    assert np.max(np.abs(terms - printed - missing)) <= rounding
    assert np.max(np.abs(missing)) / np.max(np.abs(terms)) == pytest.approx(share, abs=5e-4)
