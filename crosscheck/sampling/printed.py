"""How much a verdict rests on the last digits of its scene: channels of runs whose inputs are moved.

All numbers of the scene's file with a decimal point or an exponent are moved at once, each up or down by chance: by
`ULP` units in the last place of its 64 bits, and by half a unit of the last digit that is printed in the file. A
channel's spread is its largest distance from the run as printed over `RERUNS` such scenes, relative to the size that
its verdicts use. Runs are native's at its finest effort, `1 + 2 RERUNS` for each variant whatever the number of
inputs; channels of the contract have no derivatives by inputs that could replace them.

Zeros stay, as what is absent, and so do whole numbers, which are counts or exact. A number that cannot be moved alone
without the scene being refused (say, a component of a unit vector) stays where it is and is named. Signs that are
refused together (inertias of a plate, which has none to spare) are drawn again, up to `DRAWS` times.
"""

from __future__ import annotations

import math
import shutil
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import tomlkit
from tomlkit.items import Float

from crosscheck.engines.contract import Run
from crosscheck.engines.registry import engine
from crosscheck.engines.trajectories import signals_of
from crosscheck.judging.sizes import size_of
from crosscheck.library.case import CaseError, Variant
from crosscheck.library.channels import most_specific
from crosscheck.library.find import Case
from crosscheck.running.plan import prescribed, sample_times, variant_scene
from flexmb.output.files import write_whole
from flexmb.run.channels import distance, family, signal_range
from flexmb.run.rounding import Sizes
from flexmb.scene.check import check_scene
from flexmb.scene.files import load_scene
from flexmb.scene.reading import read_text
from flexmb.scene.schema import Scene
from flexmb.typing import Real

ENGINE = "native"
FILE = "sensitivity.json"
RERUNS = 4
RUNS = 1 + 2 * RERUNS  # of each variant
ULP = 2
DRAWS = 64  # of signs, until a scene is accepted
MOST = 1000  # numbers, for each of which the scene is compiled and evaluated twice
Place = tuple[str | int, ...]
Listener = Callable[[int, int], None]


@dataclass(frozen=True)
class PrintedNumber:
    """A number of a scene's file: where it is, and half a unit of its last printed digit."""

    place: Place
    value: float
    half_digit: float

    @property
    def name(self) -> str:
        return ".".join(map(str, self.place))


@dataclass(frozen=True)
class ChannelSpread:
    """Relative to the channel's size: `ulp` and `digits`; beside them the largest accepted E and U of native's
    comparisons on the variant, and the smallest goal; None where no figure was accepted."""

    ulp: float
    digits: float
    E: float | None
    U: float | None
    goal: float | None


@dataclass(frozen=True)
class VariantSpreads:
    """Of one variant: numbers that were `moved`, and that were `held` since the scene is refused with them; runs that
    gave no result, in words."""

    variant: str
    moved: int
    held: tuple[str, ...]
    failed: tuple[str, ...]
    channels: dict[str, ChannelSpread]


def printed_numbers(text: str) -> list[PrintedNumber]:
    """The numbers of a TOML text that are finite, not zero, and have a decimal point or an exponent."""
    return [
        PrintedNumber(place, float(number), 0.5 * 10.0 ** int(Decimal(raw).as_tuple().exponent))
        for place, number in _floats(tomlkit.parse(text), ())
        if math.isfinite(number) and number != 0.0
        for raw in (number.as_string().replace("_", ""),)
    ]


def _floats(node: Any, place: Place) -> Iterator[tuple[Place, Float]]:
    if isinstance(node, Float):
        yield place, node
    elif isinstance(node, Mapping):
        for key, value in node.items():
            yield from _floats(value, (*place, str(key)))
    elif isinstance(node, Sequence) and not isinstance(node, str):
        for index, value in enumerate(node):
            yield from _floats(value, (*place, index))


def moved_text(text: str, moves: Mapping[Place, float]) -> str:
    """The TOML text with other numbers at some places."""
    content = tomllib.loads(text)
    for place, value in moves.items():
        node: Any = content
        for step in place[:-1]:
            node = node[step]
        node[place[-1]] = value
    return tomlkit.dumps(content)


def spreads(case: Case, variant: Variant, listener: Listener = lambda done, of: None) -> VariantSpreads:
    """Run the variant `RUNS` times. CaseError if native does not run the scene as it is printed, or no moved one, or
    it has more than `MOST` numbers."""
    text = read_text(case.folder / variant.scene)
    numbers = printed_numbers(text)
    if len(numbers) > MOST:
        raise CaseError(
            f"{case.name}, {variant.name}: its scene has {len(numbers)} numbers, each of which is tried alone, and "
            f"{MOST} are the most: take a case with fewer bodies"
        )
    with TemporaryDirectory() as folder:
        place = Path(folder) / "case"
        shutil.copytree(case.folder, place)  # the scene may name files beside it

        def scene(moves: Mapping[Place, float]) -> Scene:
            write_whole(place / variant.scene, moved_text(text, moves))
            made = variant_scene(load_scene(place / variant.scene), variant)
            check_scene(made, t_end=variant.duration_s or case.run.duration_s)
            return made

        def stands(number: PrintedNumber) -> bool:
            try:
                scene({number.place: number.value + number.half_digit})
                scene({number.place: number.value - number.half_digit})
            except (ValueError, NotImplementedError):
                return False
            return True

        try:
            nominal = _channels(case, variant, scene({}))
        except (ValueError, NotImplementedError) as error:
            raise CaseError(f"{case.name}, {variant.name}: {ENGINE} does not run it: {error}") from None
        listener(1, RUNS)
        moved = [number for number in numbers if stands(number)]
        drawn = np.random.default_rng(0)

        def drawn_scene(steps: Sequence[tuple[PrintedNumber, float]]) -> Scene:
            tries = 0
            while True:
                signs, tries = drawn.choice([-1.0, 1.0], size=len(steps)), tries + 1
                moves = {number.place: number.value + s * size for s, (number, size) in zip(signs, steps, strict=True)}
                try:
                    return scene(moves)
                except (ValueError, NotImplementedError):
                    if tries == DRAWS:
                        raise

        by_ulp = [(number, ULP * math.ulp(number.value)) for number in moved]
        by_digit = [(number, number.half_digit) for number in moved]
        far: list[dict[str, float]] = []
        failed: list[str] = []
        for kind in (by_ulp, by_digit):
            apart, before = dict.fromkeys(nominal, 0.0), len(failed)
            for _ in range(RERUNS):
                try:
                    now = _channels(case, variant, drawn_scene(kind))
                except (ValueError, NotImplementedError) as error:
                    failed.append(str(error))
                    continue
                for name, values in nominal.items():
                    apart[name] = max(apart[name], float(np.max(distance(name, now[name], values))))
            if len(failed) == before + RERUNS:  # no spread is not a spread of zero
                raise CaseError(f"{case.name}, {variant.name}: no scene with moved inputs gave a result: {failed[-1]}")
            far.append(apart)
            listener(RUNS if kind is by_digit else 1 + RERUNS, RUNS)
    sizes = Sizes(tuple(nominal), nominal.__getitem__)
    found = {}
    for name, values in nominal.items():
        E, U, goal, scale = _stated(case, variant, name)
        own = 0.0 if family(name) == "energy" else signal_range(name, values)
        size = scale or size_of(own, sizes.of(name), 0.0)
        if goal is not None and size > 0.0:
            found[name] = ChannelSpread(far[0][name] / size, far[1][name] / size, E, U, goal)
    held = tuple(number.name for number in numbers if number not in moved)
    return VariantSpreads(variant.name, len(moved), held, tuple(failed), found)


def _channels(case: Case, variant: Variant, scene: Scene) -> dict[str, Real]:
    """Native's channels at its finest effort; ValueError where the run does not finish."""
    times = sample_times(case.run, variant)
    native = engine(ENGINE)
    efforts = prescribed(variant, ENGINE) or native.efforts_for(scene, float(times[-1]))  # type: ignore[attr-defined]
    run = native.compile(scene).simulate(Run(times), efforts[-1])
    if run.status != "finished":
        raise ValueError(run.message)
    return {name: values for name, values in signals_of(run).items() if name not in run.undetermined}


def _stated(
    case: Case, variant: Variant, channel: str
) -> tuple[float | None, float | None, float | None, float | None]:
    """The largest accepted E and U, the smallest goal and its scale of native's comparisons on the variant."""
    E: list[float] = []
    U: list[float] = []
    goals: list[tuple[float, float | None]] = []
    side = f"{ENGINE} ({variant.name})"
    for comparison in case.run.comparisons:
        pattern, scaled = (most_specific(table, channel) for table in (comparison.goals, comparison.scales))
        if pattern is None:
            continue
        for place, figure in case.accepted.get(comparison.name, {}).items():
            name, *sides = place.split(" | ")
            if name == channel and side in sides:
                E.append(figure.E)
                U.append(figure.U)
                goals.append((comparison.goals[pattern], comparison.scales[scaled] if scaled else None))
    goal, scale = min(goals, key=lambda each: each[0], default=(None, None))
    return max(E, default=None), max(U, default=None), goal, scale
