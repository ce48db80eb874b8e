"""The TOML file of a sweep. Unknown keys are refused with their place. A complete file::

    title = "Where the tip is after 2 s"
    case = "pendulum/double"          # a case or its folder, with `variant` [its first]; or a scene of your own:
    # scene = "scene.toml"            # beside this file, with duration_s and samples
    engines = ["native"]
    efforts = [{ engine = "native", kind = "tolerance", method = "dop853", value = 1e-8 }]   # [each engine's finest]
    sampling = "random"               # or "latin_hypercube", or "grid": every combination of `values`
    number = 200                      # not with a grid
    seed = 1                          # [0]

    [[parameter]]
    path = "bodies.rod.mass_kg"       # several paths move together; "bodies.boom.stations.*.EIy_Nm2" is every station
    distribution = "normal"           # mean, sd; or "uniform": low, high; "triangular": low, mode, high;
    mean = 2.0                        # "lognormal": median, sigma (of the logarithm); "values": values
    sd = 0.02

    [[parameter]]
    name = "stiffness"                # [the path] the column of the table
    path = "bodies.boom.stations.*.EIy_Nm2"
    relative = true                   # a factor of the scene's value
    distribution = "uniform"
    low = 0.9
    high = 1.1

    [[quantity]]
    name = "tip height"
    channel = "marker:tip.position"
    component = "z"                   # or a number from 0; [the Euclidean norm]
    value = "final"                   # "initial", "minimum", "maximum", "range", "mean", "largest" (magnitude)

A path goes through the scene by keys; items of an array go by their name, their number from 0, or `*` for all. Whole
numbers stay whole, so that a grid over `bodies.boom.elements` is a refinement.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
from scipy.special import ndtri

from crosscheck.library.case import CaseError
from crosscheck.library.channels import part_of
from crosscheck.library.check.ranges import check_duration, check_samples
from crosscheck.library.read_file import struct_of
from flexmb.scene.problems import Defect, Place
from flexmb.typing import Real

Reduction = Literal["final", "initial", "minimum", "maximum", "range", "mean", "largest"]
MOST_SAMPLES = 1_000_000


class _Parameter(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, tag_field="distribution"):
    """A number in a scene, or several that vary together; `relative` ones are multiplied by the value."""

    path: str | tuple[str, ...]
    name: str = ""
    relative: bool = False

    @property
    def paths(self) -> tuple[str, ...]:
        return (self.path,) if isinstance(self.path, str) else self.path

    @property
    def title(self) -> str:
        """The name of its column in the table."""
        return self.name or ", ".join(self.paths)

    def at(self, u: Real) -> Real:
        """The quantiles of the distribution at the probabilities `u`."""
        raise NotImplementedError

    def faults(self) -> Iterator[str]:
        """Problems of its numbers."""
        yield from ()


class Uniform(_Parameter, frozen=True, kw_only=True, tag="uniform"):
    low: float
    high: float

    def at(self, u: Real) -> Real:
        return self.low + (self.high - self.low) * u

    def faults(self) -> Iterator[str]:
        if not -math.inf < self.low < self.high < math.inf:
            yield "low must be below high, both finite"


class Normal(_Parameter, frozen=True, kw_only=True, tag="normal"):
    mean: float
    sd: float

    def at(self, u: Real) -> Real:
        return self.mean + self.sd * ndtri(u)

    def faults(self) -> Iterator[str]:
        if not (math.isfinite(self.mean) and 0.0 < self.sd < math.inf):
            yield "mean must be finite, sd positive"


class LogNormal(_Parameter, frozen=True, kw_only=True, tag="lognormal"):
    median: float
    sigma: float

    def at(self, u: Real) -> Real:
        return self.median * np.exp(self.sigma * ndtri(u))

    def faults(self) -> Iterator[str]:
        if not (0.0 < self.median < math.inf and 0.0 < self.sigma < math.inf):
            yield "median and sigma must be positive"


class Triangular(_Parameter, frozen=True, kw_only=True, tag="triangular"):
    low: float
    mode: float
    high: float

    def at(self, u: Real) -> Real:
        width, rise, fall = self.high - self.low, self.mode - self.low, self.high - self.mode
        upward, downward = self.low + np.sqrt(u * width * rise), self.high - np.sqrt((1.0 - u) * width * fall)
        return np.where(u * width < rise, upward, downward)

    def faults(self) -> Iterator[str]:
        if not (-math.inf < self.low <= self.mode <= self.high < math.inf and self.low < self.high):
            yield "low <= mode <= high must hold, with low < high"


class Values(_Parameter, frozen=True, kw_only=True, tag="values"):
    """Equally likely values."""

    values: tuple[float, ...]

    def at(self, u: Real) -> Real:
        return np.array(self.values)[np.minimum((u * len(self.values)).astype(int), len(self.values) - 1)]

    def faults(self) -> Iterator[str]:
        if not self.values or not all(map(math.isfinite, self.values)) or len(set(self.values)) < len(self.values):
            yield "values must be one number at least, all finite and different"


class SweptQuantity(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One number of a run: a reduction over time of a component of a channel, or of its norm."""

    name: str
    channel: str
    value: Reduction
    component: int | str | None = None


class SampleEffort(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The effort of an engine."""

    engine: str
    kind: Literal["tolerance", "step"]
    method: str
    value: float


class SweepFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A sweep."""

    title: str
    engines: tuple[str, ...]
    parameters: tuple[Uniform | Normal | LogNormal | Triangular | Values, ...] = msgspec.field(name="parameter")
    quantities: tuple[SweptQuantity, ...] = msgspec.field(name="quantity")
    sampling: Literal["random", "latin_hypercube", "grid"] = "random"
    number: int | None = None
    seed: int = 0
    case: str = ""
    variant: str = ""
    scene: str = ""
    duration_s: float | None = None
    samples: int | None = None
    efforts: tuple[SampleEffort, ...] = ()


def load_sweep(file: Path) -> SweepFile:
    """Read and check the file of a sweep; CaseError names file, place and remedy."""
    sweep = struct_of(file, SweepFile)
    problems = list(_problems(sweep))
    if problems:
        raise CaseError(f"{file}: {'; '.join(map(str, problems))}")
    return sweep


def _problems(sweep: SweepFile) -> Iterator[Defect]:
    root = Place()
    if bool(sweep.case) == bool(sweep.scene):
        yield Defect("$", "needs either a case or a scene", "give `case` or `scene`, one of them")
    if sweep.scene and (sweep.duration_s is None or sweep.samples is None):
        yield Defect("$", "a scene has no duration", "give `duration_s` and `samples`")
    if sweep.duration_s is not None:
        yield from check_duration(sweep.duration_s, root)
    if sweep.samples is not None:
        yield from check_samples(sweep.samples, root)
    if sweep.scene and sweep.variant:
        yield Defect("$.variant", "a scene has no variants", "leave it out")
    if sweep.seed < 0:
        yield Defect("$.seed", f"{sweep.seed} is negative", "give 0 or more")
    if sweep.sampling == "grid":
        if sweep.number is not None:
            yield Defect("$.number", "a grid has as many samples as combinations", "leave it out")
        for index, parameter in enumerate(sweep.parameters):
            if not isinstance(parameter, Values):
                remedy = 'give distribution = "values"'
                yield Defect(str(root.key("parameter", index)), "a grid needs the values themselves", remedy)
        count = math.prod(len(parameter.values) for parameter in sweep.parameters if isinstance(parameter, Values))
        if count > MOST_SAMPLES:
            yield Defect("$", f"{count} combinations are too many", f"leave at most {MOST_SAMPLES}")
    elif sweep.number is None or not 1 <= sweep.number <= MOST_SAMPLES:
        yield Defect("$.number", f"{sweep.number} samples make no sense", f"give `number`, 1 to {MOST_SAMPLES}")
    for key, names in (
        ("engines", sweep.engines),
        ("parameter", [parameter.title for parameter in sweep.parameters]),
        ("quantity", [quantity.name for quantity in sweep.quantities]),
    ):
        if not names or len(set(names)) < len(names) or not all(names):
            yield Defect(str(root.key(key)), "needs one at least, with names that differ", "name each of them")
    for index, parameter in enumerate(sweep.parameters):
        for fault in parameter.faults():
            yield Defect(str(root.key("parameter", index)), fault, f"correct {parameter.title}")
    for index, quantity in enumerate(sweep.quantities):
        if part_of(quantity.channel) is None:
            remedy = "channels are named as in run.toml, such as marker:tip.position or energy.total"
            yield Defect(str(root.key("quantity", index, "channel")), f'no channel "{quantity.channel}"', remedy)
    for index, effort in enumerate(sweep.efforts):
        if effort.engine not in sweep.engines or not 0.0 < effort.value < math.inf:
            remedy = "name one of `engines`, and give a positive value"
            yield Defect(str(root.key("efforts", index)), f"no effort of an engine here: {effort.engine}", remedy)
