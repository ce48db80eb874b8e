"""A digest of the rules by which E and U are found, made from what they compute.

A digest of the sources would change with every comment and make all accepted figures stale. Instead, made-up ladders
and signals are judged, one for each way in which U, a size or E is found, and the resulting numbers are digested.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from functools import cache

import numpy as np

from crosscheck.judging.uncertainty import RungSignal, Uncertainty, estimate, spatial
from crosscheck.judging.verdict import Signal, compare, conserve
from flexmb.run.rounding import Sizes
from flexmb.typing import Real

CHANNEL = "marker:m.position"
# Kind of effort; efforts; error of each run; evaluations.
LADDERS = (
    ("step", (0.04, 0.02, 0.01), (0.113, 0.0283, 0.00709), (0, 0, 0)),  # order 2
    ("step", (0.04, 0.02, 0.01), (0.113, 3.5e-4, 1.1e-6), (100, 200, 400)),  # more than is credited
    ("step", (0.04, 0.02, 0.01), (0.113, 0.0414, 0.0149), (0, 0, 0)),  # no whole order
    ("step", (0.04, 0.02, 0.01), (0.113, 0.0552, 0.0271), (0, 0, 0)),  # order 1
    ("step", (0.04, 0.02, 0.01), (0.113, 0.0871, 0.0703), (0, 0, 0)),  # less than order 1
    ("step", (0.04, 0.02, 0.01), (0.113, 0.00211, 0.0331), (0, 0, 0)),  # no convergence
    ("step", (0.02, 0.01), (0.0283, 0.00709), (0, 0)),
    ("tolerance", (1e-6, 1e-8, 1e-10), (0.113, 1.31e-3, 1.17e-5), (1000, 1702, 2911)),
    ("tolerance", (1e-6, 1e-7, 1e-8), (0.113, 0.0131, 1.17e-3), (1000, 1302, 1711)),
    ("tolerance", (1e-6, 1e-8, 1e-10), (0.113, 3.31e-3, 7.17e-4), (0, 0, 0)),  # E falls by less than the tolerance
    ("tolerance", (1e-6, 1e-8, 1e-10), (0.113, 5.31e-2, 1.17e-2), (1000, 1702, 2911)),  # hardly falls
    ("tolerance", (1e-6, 1e-8, 1e-10), (0.113, 1.31e-3, 1.17e-5), (1000, 1015, 1702)),  # steps not ruled by it
    ("tolerance", (1e-6, 1e-8, 1e-10), (0.113, 1.31e-3, 1.17e-5), (1000, 1041, 1702)),
    ("tolerance", (1e-5, 1e-7, 1e-9, 1e-11), (0.513, 4.91e-3, 5.07e-5, 5.01e-7), (1000, 1790, 3204, 5735)),  # even
    ("tolerance", (1e-5, 1e-7, 1e-9, 1e-11), (0.513, 4.91e-3, 3.67e-5, 3.01e-7), (1000, 1790, 3204, 5735)),
    ("tolerance", (1e-5, 1e-7, 1e-9, 1e-11), (0.513, 4.91e-3, 5.07e-5, 5.01e-7), (1000, 1440, 2074, 2986)),  # too fast
    ("tolerance", (1e-5, 1e-7, 1e-9, 1e-11), (0.513, 4.91e-3, 5.07e-5, 5.01e-7), (1000, 1790, 3204, 9035)),  # much more
    ("tolerance", (1e-6, 1e-8, 1e-10), (0.113, 0.113, 0.113), (1000, 1702, 2911)),  # equal to the last digit
)


@cache
def rule() -> str:
    """Six hexadecimal digits that identify the rules for E and U."""
    return short_digest(" ".join(_numbers()))


def short_digest(text: str) -> str:
    """Six hexadecimal digits of a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:6]


def _numbers() -> Iterator[str]:
    """Four digits of every resulting number, so that rounding does not matter."""
    times = np.linspace(0.0, 1.3, 27)
    for kind, efforts, errors, evaluations in LADDERS:
        rungs = [
            RungSignal(effort, _signal(times, error), count)
            for effort, error, count in zip(efforts, errors, evaluations, strict=True)
        ]
        estimated = estimate(CHANNEL, kind, rungs, 1.7)
        yield f"{estimated.value:.4g} {estimated.envelope[9]:.4g}"
    for order in (1.0, 4.0):
        fine, coarse = (_signal(times, error) for error in (0.011, 0.083))
        yield f"{spatial(CHANNEL, coarse, fine, 2.0, order)[-1]:.4g}"
    for size in (1.0, 1e-9, 1e-13, 1e-17):
        yield " ".join(_judged(times, size))
    drift = conserve(0.0137 * times, 2.9, 0.1)
    yield f"{drift.status} {drift.E:.4g}"


def _judged(times: Real, size: float) -> Iterator[str]:
    """E and U of positions, orientations, forces and energies, with forces of the given size."""
    turned = np.stack([np.cos(0.4 * times), *(0.6 * np.sin(0.4 * times),) * 2, 0.5 * np.sin(0.4 * times)], axis=1)
    channels = {
        CHANNEL: _signal(times, 0.0),
        "marker:m.orientation": turned / np.linalg.norm(turned, axis=1)[:, None],
        "marker:n.position": 1e-8 * _signal(times, 0.0),
        "load:h.force": size * _signal(times, 0.07),
        "load:g.force": 0.31 * size * _signal(times, 0.03),
        "load:h.torque": 2.3 * _signal(times, 0.02),
        "energy.kinetic": 3.1 * times[:, None],
        "energy.gravity": 0.2 * times[:, None],
    }
    sizes = Sizes(tuple(channels), channels.__getitem__)
    for name, values in channels.items():
        doubt = Uncertainty(np.full(len(times), 3.7e-10), 3.7e-10, "")
        one = Signal(values, doubt, sizes.of(name))
        other = Signal(values * (1.0 + 1.3e-10), doubt, sizes.of(name))
        verdict = compare(name, one, other, 1.0)
        roundings = " ".join(f"{sizes.magnitude(name, count):.4g}" for count in (0, 10**8))
        yield f"{verdict.status} {verdict.E or 0.0:.4g} {verdict.U or 0.0:.4g} {roundings}"


def _signal(times: Real, error: float) -> Real:
    """A motion (T, 3) that is off by an error that grows with time."""
    exact = np.stack([np.sin(2.1 * times), np.cos(1.7 * times), 0.3 * times], axis=1)
    return exact + error * (0.2 + times)[:, None] * np.array([0.6, 0.48, 0.64])
