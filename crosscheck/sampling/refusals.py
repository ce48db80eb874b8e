"""Checks of a sweep against its scene and its engines, before the first of possibly a million samples."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from crosscheck.engines.answers import clean
from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import EngineMissing
from crosscheck.engines.registry import NoSuchEngine, find_engine
from crosscheck.library.case import CaseError
from crosscheck.library.channels import part_of
from crosscheck.sampling.file import SampleEffort, SweepFile, SweptQuantity
from crosscheck.sampling.sample import LETTERS, place_of
from crosscheck.sampling.values import require_numbers
from flexmb.scene.problems import Defect, Place, closest
from flexmb.scene.schema import Scene
from flexmb.typing import Real


def require_sense(file: Path, sweep: SweepFile, scene: Scene, times: Real, values: Real, provider: str) -> None:
    """CaseError naming the file, every place and its remedy: paths without a number, unknown items, engines, methods.

    `values` are those of all samples (number of samples, number of parameters), `times` (T,) s when each is sampled.
    """
    try:
        _require_finite(sweep, values)
        require_numbers(scene, sweep, values)
    except CaseError as error:
        raise CaseError(f"{file}: {error}") from None
    problems = [*_quantities(sweep, scene), *_engines(sweep, scene, float(times[-1]), provider)]
    if problems:
        raise CaseError(f"{file}: {'; '.join(map(str, problems))}")


def _require_finite(sweep: SweepFile, values: Real) -> None:
    """Distributions with finite parameters may still be so wide that drawn values overflow."""
    for parameter, drawn in zip(sweep.parameters, values.T, strict=True):
        if not np.all(np.isfinite(drawn)):
            what = f'parameter "{parameter.path}": {np.sum(~np.isfinite(drawn))} of {len(drawn)} values drawn overflow'
            raise CaseError(f"{what}: give a narrower distribution")


def _quantities(sweep: SweepFile, scene: Scene) -> Iterator[Defect]:
    for index, quantity in enumerate(sweep.quantities):
        place = Place().key("quantity", index).named(f'quantity "{quantity.name}"')
        kind, _, rest = quantity.channel.partition(":")
        if kind in (items := _items(scene)) and (name := rest.rpartition(".")[0]) not in items[kind]:
            what = f'no {kind.replace("_", " ")} "{name}"'
            yield Defect(str(place.key("channel")), what, closest(name, items[kind]))
        if wrong := _component(quantity):
            yield Defect(str(place.key("component")), *wrong)


def _items(scene: Scene) -> dict[str, list[str]]:
    """The names of the scene's items by kind of channel."""
    of = {
        "marker": scene.markers, "load": (*scene.hinges, *scene.constraints),
        "total_load": scene.total_loads, "wheel_load": scene.wheels, "connector": scene.connectors,
    }  # fmt: skip
    return {kind: [item.name for item in items] for kind, items in of.items()}


def _component(quantity: SweptQuantity) -> tuple[str, str] | None:
    part, component = part_of(quantity.channel), quantity.component
    width = None if part is None else part.width
    if component is None or width is None or place_of(component, width) is not None:
        return None
    letters = LETTERS.get(width, "")
    choice = f"{', '.join(letters)}, or " if letters else ""
    return f"{quantity.channel} has no component {component!r}", f"give {choice}a number from 0 to {width - 1}"


def _engines(sweep: SweepFile, scene: Scene, duration_s: float, provider: str) -> Iterator[Defect]:
    for index, name in enumerate(sweep.engines):
        try:
            engine = CheckedEngine(find_engine(provider, name), duration_s=duration_s)
        except NoSuchEngine as error:
            yield Defect(str(Place().key("engines", index)), str(error), "`crosscheck engines` shows them")
            continue
        try:
            engine.version()
        except EngineMissing as error:
            yield Defect(str(Place().key("engines", index)), clean(str(error)), "install it, or leave the engine out")
            continue
        except Exception:  # it does not work: every sample reports that
            continue
        for number, effort in enumerate(sweep.efforts):
            if effort.engine != name:
                continue
            try:
                own = {effort.method for effort in engine.efforts(scene)}.union(getattr(engine.engine, "methods", ()))
            except Exception:  # it refuses the scene: every sample reports that
                continue
            if wrong := _method(effort, own):
                yield Defect(str(Place().key("efforts", number, "method")), *wrong)


def _method(effort: SampleEffort, known: set[str]) -> tuple[str, str] | None:
    if effort.method in known:
        return None
    return f'{effort.engine} has no method "{effort.method}"', closest(effort.method, known)
