"""U of tolerance ladders bounds the error wherever the library knows the solution in closed form."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.registry import engines
from crosscheck.judging.uncertainty import RungSignal, estimate
from crosscheck.library.find import Case, resolve
from crosscheck.library.reference import load_reference
from crosscheck.library.selection import held
from crosscheck.running.plan import variant_scene
from flexmb.run.channels import channels_of, distance, family, magnitude

TOLERANCES = tuple(10.0**-n for n in range(4, 13))
CLOSED = [case for case in resolve(("all",)) if case.provenance is not None and case.provenance.family == "closed_form"]


def ladders(case: Case, engine: str) -> tuple[int, list[str]]:
    """How many ladders of three tolerances there are, a tenth or a hundredth apart, and those whose U is exceeded."""
    assert case.run.reference is not None
    reference = load_reference(case.folder)
    variant = case.run.variant(case.run.reference.variant)
    found = engines()[engine]
    model = found.compile(variant_scene(case.scene(variant), variant))
    method = found.efforts(case.scene(variant))[0].method
    runs = [model.simulate(Run(reference.times), Effort("tolerance", value, method)) for value in TOLERANCES]
    signals = [channels_of(run) for run in runs]
    count, exceeded = 0, []
    for channel, known in reference.knowledge.channels.items():
        if channel not in signals[-1]:
            continue
        size = max(magnitude(name, values) for name, values in signals[-1].items() if family(name) == family(channel))
        errors = [float(np.max(distance(channel, each[channel], reference.channels[channel]))) for each in signals]
        for stride, first in product((1, 2), range(len(TOLERANCES))):
            places = range(first, first + 2 * stride + 1, stride)
            if places[-1] >= len(TOLERANCES):
                continue
            rungs = [RungSignal(TOLERANCES[place], signals[place][channel]) for place in places]
            bound = estimate(channel, "tolerance", rungs, runs[places[-1]].evaluations, size).value
            count += 1
            if errors[places[-1]] > bound + known.uncertainty:
                exceeded.append(f"{channel} to {TOLERANCES[places[-1]]:g}: {errors[places[-1]]:.2g} > {bound:.2g}")
    return count, exceeded


@pytest.mark.slow
@pytest.mark.parametrize("case", CLOSED, ids=lambda case: case.name)
@pytest.mark.parametrize("engine", ["native", "pinocchio"])
def test_u_bounds_the_error(case: Case, engine: str) -> None:
    assert case.run.reference is not None
    runs_it = engine in case.run.variant(case.run.reference.variant).engines
    if not (runs_it and engine in held(case.run, (engine,))):
        pytest.skip(f"{case.name} does not hold {engine} against its reference")
    count, exceeded = ladders(case, engine)
    assert count and not exceeded
