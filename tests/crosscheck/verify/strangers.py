"""Files of strangers: converged runs by another algorithm than the reference's, at times of their own."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import msgspec
import numpy as np

import flexmb as fm
from crosscheck.library.find import Case, load_case, shipped_folder
from crosscheck.library.mutations import CATALOGUE, applicable, mutate
from crosscheck.library.reference import StoredReference, current_reference, values_text
from crosscheck.running.plan import at_level, variant_scene
from flexmb.run.channels import channels_of
from flexmb.scene.schema import Scene
from flexmb.typing import Real


@dataclass(frozen=True)
class Stranger:
    """Somebody who solves a case by `algorithm` and `method`, and whose clock is `late` (parts of the duration) if it
    is wrong."""

    name: str
    algorithm: str = "composite"
    method: str = "dop853"
    rtol: float = 1e-12
    late: float = 1e-3

    @cached_property
    def case(self) -> Case:
        return load_case(shipped_folder() / self.name)

    @cached_property
    def stored(self) -> StoredReference:
        return current_reference(self.case)

    @cached_property
    def scene(self) -> Scene:
        variant = self.case.run.variant(self.stored.knowledge.variant)
        return variant_scene(at_level(self.case.scene(variant), variant), msgspec.structs.replace(variant, level=None))

    @cached_property
    def heavier(self) -> Scene:
        """The scene with 1 % more mass of a body, where that changes the motion or loads."""
        target = applicable(self.scene, CATALOGUE["mass"])[-1]
        return mutate(self.scene, "mass", target.name)

    def solution(self, times: Real, scene: Scene | None = None) -> dict[str, Real]:
        """All channels at `times` (T,) s, within the stored horizon."""
        asked = np.unique(np.concatenate([[0.0], times, self.stored.times[-1:]]))
        run = fm.simulate(
            scene or self.scene, float(asked[-1]), self.method, samples=asked, algorithm=self.algorithm,
            rtol=self.rtol, atol=1e-2 * self.rtol,
        )  # type: ignore[arg-type]  # fmt: skip
        assert run.finished, run.message
        kept = np.searchsorted(asked, times)
        channels = {name: rows[kept] for name, rows in channels_of(run).items()}
        return {name: rows for name, rows in channels.items() if name in self.stored.channels}

    def right(self, file: Path, times: Real) -> Path:
        return written(file, times, self.solution(times))

    def too_heavy(self, file: Path, times: Real) -> Path:
        return written(file, times, self.solution(times, self.heavier))

    def too_late(self, file: Path, times: Real) -> Path:
        """Right values with a clock that is late, which stands still until then."""
        return written(file, times, self.solution(np.maximum(times - self.late * self.stored.times[-1], 0.0)))


def written(file: Path, times: Real, channels: dict[str, Real]) -> Path:
    """A CSV with the columns of a reference.csv."""
    file.write_text(values_text(times, channels), encoding="utf-8")
    return file


def _uniform(random: np.random.Generator, stored: Real) -> Real:
    return np.linspace(0.0, stored[-1], int(random.integers(12, 300)))


def _random(random: np.random.Generator, stored: Real) -> Real:
    """Any times; they begin within their largest step, and end so."""
    while True:
        times = np.unique(random.uniform(0.0, stored[-1], int(random.integers(12, 300))))
        if max(times[0], stored[-1] - times[-1]) <= np.max(np.diff(times)):
            return times


def _subset(random: np.random.Generator, stored: Real) -> Real:
    inner = random.choice(np.arange(1, len(stored) - 1), size=int(random.integers(8, len(stored) - 2)), replace=False)
    return stored[np.sort(np.concatenate([[0], inner, [len(stored) - 1]]))]


def _finer(random: np.random.Generator, stored: Real) -> Real:
    """The stored times and others in between."""
    parts, places = int(random.integers(2, 5)), np.arange(len(stored))
    between = np.arange(parts * (len(stored) - 1)) / parts
    return np.union1d(stored, np.interp(between[between % 1.0 > 0.0], places, stored))


def _fixed_step(random: np.random.Generator, stored: Real) -> Real:
    """Steps that do not divide the duration: the last sample is before its end."""
    return np.arange(0.0, stored[-1], stored[-1] / random.uniform(20.0, 300.0))


Resampling = Callable[[np.random.Generator, Real], Real]
RESAMPLINGS: tuple[Resampling, ...] = (_uniform, _random, _subset, _finer, _fixed_step)
STRANGERS = (
    Stranger("pendulums/double"), Stranger("tops/lagrange"), Stranger("tops/kovalevskaya"),
    Stranger("wheel_gyrostat/torque_driven"), Stranger("closed_chains/four_bar"), Stranger("sliders/crane"),
    Stranger("deploying_boom/latching"), Stranger("control/servos"), Stranger("spinning_beam/beam_s_subcritical"),
    Stranger("connectors/one_at_a_time"),
)  # fmt: skip
