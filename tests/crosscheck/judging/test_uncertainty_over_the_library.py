"""U of tolerance ladders bounds the error, over every variant of the library that an engine runs.

The truth is the closed form where the library has one, and the engine's own finest run everywhere else: no rounding or
conditioning that all runs share shows there, but how errors scatter about the tolerance does.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
import pytest

from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.registry import engines
from crosscheck.judging.uncertainty import RungSignal, estimate
from crosscheck.library.case import Variant
from crosscheck.library.channels import LINEAR_KINDS
from crosscheck.library.find import Case, resolve
from crosscheck.library.reference import load_reference
from crosscheck.library.selection import goals_for_reference
from crosscheck.running.plan import variant_scene
from flexmb.run.channels import channels_of, distance, family, magnitude
from flexmb.typing import Real

TOLERANCES = tuple(10.0**-n for n in range(4, 13))
FINEST = 1e-13
SAMPLES = 201
TOO_LONG = ("chains/thousand_rods",)
CASES = [case for case in resolve(("all",)) if case.name not in TOO_LONG]
CLOSED = [case for case in CASES if case.provenance is not None and case.provenance.family == "closed_form"]
STEPS = ("native", "step")
PAIRS = [
    (case, variant)
    for case in CASES
    for variant in case.run.variants
    if "native" in variant.engines
    and variant.start != "equilibrium"  # what rests moves by the rounding of its forces alone
    and STEPS not in {(item.engine, item.kind) for item in variant.efforts}
]


@dataclass(frozen=True)
class Ladder:
    """One run at each of `tolerances`, coarse to fine: channels (T, k) and evaluations."""

    tolerances: tuple[float, ...]
    signals: tuple[Mapping[str, Real], ...]
    evaluations: tuple[int, ...]

    def judged(self, channel: str) -> Iterator[tuple[int, float]]:
        """Place of the finest run of each ladder of three or four runs, a tenth or a hundredth apart, and its U."""
        finest = self.signals[-1]
        size = max(magnitude(name, values) for name, values in finest.items() if family(name) == family(channel))
        for stride, count, first in product((1, 2), (3, 4), range(len(self.tolerances))):
            places = range(first, first + (count - 1) * stride + 1, stride)
            if places[-1] < len(self.tolerances):
                rungs = [
                    RungSignal(self.tolerances[place], self.signals[place][channel], self.evaluations[place])
                    for place in places
                ]
                yield places[-1], estimate(channel, "tolerance", rungs, size).value


def kind_of(channel: str) -> str:
    return family(channel).partition(".")[0]


def climbed(case: Case, variant: Variant, engine: str, times: Real, tolerances: tuple[float, ...]) -> Ladder:
    found = engines()[engine]
    scene = case.scene(variant)
    model = found.compile(variant_scene(scene, variant))
    method = found.efforts(scene)[0].method
    runs = [model.simulate(Run(times), Effort("tolerance", value, method)) for value in tolerances]
    ended = [n for n, run in enumerate(runs) if run.status == "finished"]  # a tolerance too coarse may diverge
    return Ladder(
        tuple(tolerances[n] for n in ended),
        tuple(channels_of(runs[n]) for n in ended),
        tuple(runs[n].evaluations for n in ended),
    )


@pytest.mark.slow
@pytest.mark.parametrize("case", CLOSED, ids=lambda case: case.name)
@pytest.mark.parametrize("engine", ["native", "pinocchio"])
def test_u_bounds_the_error(case: Case, engine: str) -> None:
    assert case.run.reference is not None
    variant = case.run.variant(case.run.reference.variant)
    if not (engine in variant.engines and engine in goals_for_reference(case.run, (engine,))):
        pytest.skip(f"{case.name} does not hold {engine} against its reference")
    reference = load_reference(case.folder)
    if not any(kind_of(channel) not in LINEAR_KINDS for channel in reference.channels):
        pytest.skip(f"{case.name} has a reference of the linearised motion alone, which no integration gives")
    ladder = climbed(case, variant, engine, reference.times, TOLERANCES)
    exceeded, count = [], 0
    for channel, known in reference.knowledge.channels.items():
        if channel not in ladder.signals[-1]:
            continue
        truth = reference.channels[channel]
        errors = [float(np.max(distance(channel, signal[channel], truth))) for signal in ladder.signals]
        for place, bound in ladder.judged(channel):
            count += 1
            if errors[place] > bound + known.uncertainty:
                exceeded.append(f"{channel} to {ladder.tolerances[place]:g}: {errors[place]:.2g} > {bound:.2g}")
    assert count and not exceeded


@pytest.mark.slow
@pytest.mark.parametrize(("case", "variant"), PAIRS, ids=lambda each: each.name)
def test_u_bounds_the_distance_to_the_finest_run(case: Case, variant: Variant) -> None:
    """The finest run is as far from the truth as its own U says at most."""
    times = np.linspace(0.0, case.run.duration_s, min(case.run.samples, SAMPLES))
    ladder = climbed(case, variant, "native", times, (*TOLERANCES, FINEST))
    exceeded, count = [], 0
    for channel, truth in ladder.signals[-1].items():
        errors = [float(np.max(distance(channel, signal[channel], truth))) for signal in ladder.signals]
        for place, bound in ladder.judged(channel):
            if place < len(ladder.tolerances) - 1:
                count += 1
                if errors[place] > bound + errors[-2]:
                    exceeded.append(f"{channel} to {ladder.tolerances[place]:g}: {errors[place]:.2g} > {bound:.2g}")
    assert count and not exceeded
