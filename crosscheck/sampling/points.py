"""The parameter values of all samples of a sweep; they depend on the seed only."""

from __future__ import annotations

import itertools

import numpy as np

from crosscheck.sampling.file import SweepFile, Values
from flexmb.typing import Real


def sample_values(sweep: SweepFile) -> Real:
    """Values (number of samples, number of parameters).

    Random sample n has a generator of its own (`SeedSequence.spawn`), so that a larger `number`
    keeps the existing samples. A Latin hypercube with another number has entirely different samples.
    """
    if sweep.sampling == "grid":
        axes = [each.values for each in sweep.parameters if isinstance(each, Values)]
        return np.array(list(itertools.product(*axes)))
    assert sweep.number is not None
    shape = (sweep.number, len(sweep.parameters))
    parts = _latin_hypercube(sweep.seed, *shape) if sweep.sampling == "latin_hypercube" else _random(sweep.seed, *shape)
    inside = np.clip(parts, np.finfo(float).tiny, None)  # the normal distribution has no quantile at 0
    return np.column_stack([each.at(inside[:, column]) for column, each in enumerate(sweep.parameters)])


def _random(seed: int, number: int, parameters: int) -> Real:
    """Independent points of the unit cube, (number, parameters)."""
    seeds = np.random.SeedSequence(seed).spawn(number)
    return np.array([np.random.default_rng(each).random(parameters) for each in seeds])


def _latin_hypercube(seed: int, number: int, parameters: int) -> Real:
    """Points (number, parameters) of which exactly one lies in each n-th part of each axis."""
    generator = np.random.default_rng(np.random.SeedSequence(seed))
    strata = generator.permuted(np.tile(np.arange(number), (parameters, 1)), axis=1).T
    return (strata + generator.random((number, parameters))) / number
