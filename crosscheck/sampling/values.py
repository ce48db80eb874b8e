"""The samples of a sweep: the values of its parameters, which depend on the seed only, and the scene with them."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import Any

import numpy as np

from crosscheck.library.case import CaseError
from crosscheck.sampling.file import SweepFile, Values
from flexmb.scene.schema import Scene
from flexmb.scene.values import PathError, changed_at, number_at
from flexmb.typing import Real


def with_values(scene: Scene, sweep: SweepFile, values: Iterable[float]) -> Scene:
    """The scene with the value of each parameter; CaseError names a path that leads to no number, and the remedy."""
    for parameter, value in zip(sweep.parameters, values, strict=True):
        for path in parameter.paths:

            def changed(old: Any, path: str = path, value: float = value, relative: bool = parameter.relative) -> float:
                given = value * old if relative and isinstance(old, int | float) else value
                return number_at(path, old, given)

            try:
                scene = changed_at(scene, path, changed)
            except PathError as problem:
                raise CaseError(str(problem)) from None
    return scene


def require_numbers(scene: Scene, sweep: SweepFile, values: Real) -> None:
    """CaseError, as of `with_values`, where a path leads to no number, or to one that some sample's value does not fit.

    `values` (number of samples, number of parameters). A count takes whole numbers alone, in every sample.
    """
    for column, parameter in enumerate(sweep.parameters):
        different = np.unique(values[:, column])
        for path in parameter.paths:

            def fits(old: Any, path: str = path, relative: bool = parameter.relative, given: Real = different) -> Any:
                number_at(path, old, 0.0)
                if isinstance(old, int):
                    for value in given:
                        number_at(path, old, value * old if relative else value)
                return old

            try:
                changed_at(scene, path, fits)
            except PathError as problem:
                raise CaseError(str(problem)) from None


def sample_values(sweep: SweepFile) -> Real:
    """Values (number of samples, number of parameters).

    Random sample n has a generator of its own (`SeedSequence.spawn`), so that a larger `number`
    keeps the existing samples. A Latin hypercube with another number has entirely different samples.
    """
    if sweep.sampling == "grid":
        axes = [parameter.values for parameter in sweep.parameters if isinstance(parameter, Values)]
        return np.array(list(itertools.product(*axes)))
    assert sweep.number is not None
    shape = (sweep.number, len(sweep.parameters))
    parts = _latin_hypercube(sweep.seed, *shape) if sweep.sampling == "latin_hypercube" else _random(sweep.seed, *shape)
    inside = np.clip(parts, np.finfo(float).tiny, None)  # the normal distribution has no quantile at 0
    return np.column_stack([parameter.at(inside[:, column]) for column, parameter in enumerate(sweep.parameters)])


def _random(seed: int, number: int, parameters: int) -> Real:
    """Independent points of the unit cube, (number, parameters)."""
    seeds = np.random.SeedSequence(seed).spawn(number)
    return np.array([np.random.default_rng(seed).random(parameters) for seed in seeds])


def _latin_hypercube(seed: int, number: int, parameters: int) -> Real:
    """Points (number, parameters) of which exactly one lies in each n-th part of each axis."""
    generator = np.random.default_rng(np.random.SeedSequence(seed))
    strata = generator.permuted(np.tile(np.arange(number), (parameters, 1)), axis=1).T
    return (strata + generator.random((number, parameters))) / number
