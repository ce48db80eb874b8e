"""Parameters from the recursion's integrals and back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexmb.frisch.parameters import mode_parameters
from flexmb.modal.integrals import modal_integrals
from tests.bounds import gamma
from tests.flexmb.frisch import exact
from tests.flexmb.frisch.conversion import from_integrals, to_integrals

PARTICLES, TURNING = exact.random_body(1, particles=True), exact.random_body(2)
MIXED = replace(
    TURNING,
    inertia=TURNING.inertia * np.array([0, 1, 1, 0, 1, 0])[:, None, None],
    com_offset=TURNING.com_offset * np.array([0, 0, 1, 0, 1, 1])[:, None],
)
BODIES = [PARTICLES, TURNING, MIXED]


def assert_same(a, b, roundings: int) -> None:
    """All numbers of two dataclasses agree, judged by the largest number of both: all are of order one here."""
    numbers = [name for name in a.__dataclass_fields__ if isinstance(getattr(a, name), (float, np.ndarray))]
    size = max(float(np.max(np.abs(getattr(a, name)))) for name in numbers)
    for name in numbers:
        assert np.max(np.abs(getattr(a, name) - getattr(b, name))) <= gamma(roundings) * size, name


@pytest.mark.parametrize("as_printed", [False, True])
@pytest.mark.parametrize("body", BODIES)
def test_integrals_give_all_parameters(body, as_printed):
    """(8), (17), (48)-(72): nothing is missing, for points that turn are kept in the integrals."""
    found = from_integrals(modal_integrals(body), as_printed=as_printed)
    assert_same(mode_parameters(body, as_printed=as_printed), found, 40 + len(body.mass))


@pytest.mark.parametrize("body", BODIES)
def test_round_trip(body):
    """Integrals from parameters and the points that turn, and parameters again from those."""
    integrals, parameters = modal_integrals(body), mode_parameters(body)
    back = to_integrals(parameters, integrals.turning)
    assert_same(integrals, back, 40 + len(body.mass))
    assert_same(parameters, from_integrals(back), 80 + len(body.mass))


def test_particles_need_no_turning_points():
    assert_same(modal_integrals(PARTICLES), to_integrals(mode_parameters(PARTICLES)), 40 + len(PARTICLES.mass))


def test_single_turning_points_cannot_be_had_from_their_sums():
    with pytest.raises(ValueError, match="points cannot be recovered from the sums"):
        to_integrals(mode_parameters(TURNING))
    with pytest.raises(ValueError, match="not the printed ones"):
        to_integrals(mode_parameters(PARTICLES, as_printed=True))
