"""Inputs that a set does not state are identified by a part of its readings, and the rest of them is predicted.

Of all inputs x, those of `fit` have no prior, and the others that which the file declares, of value x0 and deviation s:

    minimise  sum over the identifying readings ((S(x) - D) / u_D)^2  +  sum over the other inputs ((x - x0) / s)^2.

With J the derivatives of these terms, each input in units of its deviation, the posterior covariance is (J' J)^-1, to
first order. It is not scaled by the misfit: readings of a model that is wrong fit badly, and the prediction leaves its
band, which is what is to be seen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from crosscheck.library.case_error import CaseError
from crosscheck.validation.measured_set import FILE, Input, MeasuredSet
from crosscheck.validation.model import Listener, MeasuredModel
from flexmb.typing import Real

UNSEEN = 1e-8  # ratio of singular values below which readings do not determine a combination of inputs
MOST_RUNS = 60


@dataclass(frozen=True)
class Identified:
    """Of I inputs: the set with their identified values and deviations and with the readings that are predicted, the
    correlation (I,I) of the inputs, how many readings identified them, and the root mean square of what is left there,
    over the deviation of each reading."""

    of: MeasuredSet
    correlation: Real
    readings: int
    misfit: float


def identified(of: MeasuredSet, listener: Listener = lambda done, of: None) -> Identified:
    """Find the inputs of `fit`; CaseError where the search does not end, or readings do not determine them."""
    content, file = of.content, of.folder / FILE
    used = tuple(point for point in of.points if of.identifies(point))
    measured, u_D = np.array([point.measured for point in used]), np.array([of.deviation(point) for point in used])
    free = [i for i, each in enumerate(content.inputs) if each.deviation > 0.0]
    prior = np.array([each.name not in content.fit for each in content.inputs])[free]
    model = MeasuredModel(of, listener)

    def inputs_at(z: Real) -> list[Input]:
        inputs = list(content.inputs)
        for i, each in zip(free, z, strict=True):
            given = inputs[i]
            inputs[i] = msgspec.structs.replace(given, value=given.value + float(each) * given.deviation)
        return inputs

    def residuals(z: Real) -> Real:
        values = {each.name: each.value for each in inputs_at(z)}
        return np.concatenate([(model.predictions(used, values, 1) - measured) / u_D, z[prior]])

    def slopes(z: Real) -> Real:
        by_input = model.slopes(used, inputs_at(z))[:, free]
        return np.concatenate([by_input / u_D[:, None], np.eye(len(free))[prior]])

    found = least_squares(residuals, np.zeros(len(free)), slopes, x_scale="jac", xtol=1e-10, ftol=1e-12, gtol=1e-12,
                          max_nfev=MOST_RUNS)  # fmt: skip
    if found.status == 0:
        raise CaseError(f"{file}: fit: the search did not end within {MOST_RUNS} runs: begin nearer, at other values")
    J = slopes(found.x)
    _refuse_undetermined(J, [content.inputs[i].name for i in free], str(file))
    covariance = np.linalg.inv(J.T @ J)
    spread, correlation = np.sqrt(np.diag(covariance)), np.eye(len(content.inputs))
    correlation[np.ix_(free, free)] = covariance / np.outer(spread, spread)
    inputs = inputs_at(found.x)
    for i, size in zip(free, spread, strict=True):
        width = float(size) * inputs[i].deviation
        inputs[i] = msgspec.structs.replace(inputs[i], width=width, kind="standard")
    left = residuals(found.x)[: len(used)]
    rest = tuple(point for point in of.points if not of.identifies(point))
    known = replace(of, content=msgspec.structs.replace(content, inputs=tuple(inputs)), points=rest)
    return Identified(known, correlation, len(used), float(np.sqrt(np.mean(left**2))))


def _refuse_undetermined(J: Real, names: list[str], file: str) -> None:
    """Columns are scaled, so that the sizes of deviations do not matter."""
    sizes = np.linalg.norm(J, axis=0)
    blind = [name for name, size in zip(names, sizes, strict=True) if not size > 0.0]
    if not blind:
        _, values, rows = np.linalg.svd(J / sizes)
        if len(J) < len(names) or values[-1] < UNSEEN * values[0]:
            largest: NDArray[np.intp] = np.argsort(-np.abs(rows[-1]))
            blind = [names[i] for i in largest[:3] if abs(rows[-1][i]) > 0.1]
    if blind:
        words = ", ".join(f'"{name}"' for name in blind)
        raise CaseError(f"{file}: fit: the readings do not determine {words}: leave one out of fit, or give its width")
