"""The program of a measured set: its predictions, how they change with the inputs, and what is refused of either."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from crosscheck.library.case_error import CaseError
from crosscheck.library.code import executed, function_in
from crosscheck.validation.measured_set import MODEL, Input, MeasuredSet, Reading
from flexmb.scene.problems import closest
from flexmb.typing import Real

TRIED = 1.0 / 64.0  # part of a deviation over which the difference is formed that an exact derivative is held against
WRONG = 0.01  # how far both may be apart: part of the largest in the series, and of the deviation of the reading

Listener = Callable[[int, int], None]


class Changes(NamedTuple):
    """Change (N,I) of the predictions by one deviation of each input, how far two ways to find it are apart (N,I),
    and for each input whether it is by an exact derivative."""

    by_input: Real
    curved: Real
    exact: tuple[bool, ...]


@dataclass
class MeasuredModel:
    """The functions of `model.py`; `listener` hears how many of the evaluations that are expected are done."""

    of: MeasuredSet
    listener: Listener = lambda done, of: None
    expected: int = 0
    _done: int = 0
    _module: Any = field(init=False)
    _predict: Callable[..., Any] = field(init=False)

    def __post_init__(self) -> None:
        """Execute the file; CaseError if it has no `predict`, or if user code is forbidden."""
        file = self.of.folder / MODEL
        self._module = executed(file, "it predicts the points")
        takes, gives = "points, inputs, effort", "a number for each point"
        self._predict = function_in(self._module, file, "predict", takes, gives)

    def predictions(self, points: Sequence[Reading], inputs: Mapping[str, float], effort: int) -> Real:
        """(N,) in the units of the series; CaseError where the model raises, or gives no finite number for a point."""
        answer = self._asked(self._predict, "predict", points, inputs, effort)
        return self._finite(answer, f"predict at effort {effort}: what it gave", points)

    def derivatives(
        self, points: Sequence[Reading], values: Mapping[str, float], inputs: Sequence[Input]
    ) -> dict[str, Real]:
        """(N,) by input, of those that the model has derivatives by; CaseError for others, and as `predictions`."""
        function = getattr(self._module, "derivatives", None)
        if function is None:
            return {}
        where = f"{self.of.folder / MODEL}: derivatives"
        answer = self._asked(function, "derivatives", points, values, 1)
        if not isinstance(answer, Mapping):
            raise CaseError(f"{where}: it gave a {type(answer).__name__}: give a dict of numbers by input")
        known = [each.name for each in inputs]
        for name in answer:
            if name not in known:
                raise CaseError(f'{where}: "{name}" is no input: {closest(str(name), known)}')
        return {name: self._finite(row, f'derivatives: by "{name}" it', points) for name, row in answer.items()}

    def changes(self, points: Sequence[Reading], inputs: Sequence[Input]) -> Changes:
        """Changes by one deviation of each input about the values of all.

        An exact derivative is held against a central difference over a small part of the deviation, and a wrong one is
        a CaseError that names the input. All others are central differences over the deviation and over half of it,
        combined to fourth order.
        """
        values = {each.name: each.value for each in inputs}
        exact = self.derivatives(points, values, inputs)
        self.expected -= 2 * len(exact)
        by_input, curved = np.zeros((len(points), len(inputs))), np.zeros((len(points), len(inputs)))

        for i, each in enumerate(inputs):
            if each.deviation == 0.0:
                continue
            if each.name in exact:
                by_input[:, i] = exact[each.name] * each.deviation
                tried = self._difference(points, values, each, TRIED)
                curved[:, i] = np.abs(tried - by_input[:, i])
                self._refuse_wrong(each, points, by_input[:, i], tried)
            else:
                wide, near = (self._difference(points, values, each, part) for part in (1.0, 0.5))
                by_input[:, i], curved[:, i] = (4.0 * near - wide) / 3.0, np.abs(near - wide)
        return Changes(by_input, curved, tuple(each.name in exact for each in inputs))

    def slopes(self, points: Sequence[Reading], inputs: Sequence[Input]) -> Real:
        """As `changes`, unverified and of second order over a small part of the deviation: what a search needs."""
        values = {each.name: each.value for each in inputs}
        exact = self.derivatives(points, values, inputs)
        columns = [
            np.zeros(len(points)) if each.deviation == 0.0
            else exact[each.name] * each.deviation if each.name in exact
            else self._difference(points, values, each, TRIED)
            for each in inputs
        ]  # fmt: skip
        return np.column_stack(columns)

    def _difference(self, points: Sequence[Reading], values: Mapping[str, float], each: Input, part: float) -> Real:
        """Central difference over a part of the deviation, for a change by one deviation."""
        step = part * each.deviation
        high, low = (
            self.predictions(points, {**values, each.name: each.value + sign * step}, 1) for sign in (1.0, -1.0)
        )
        return (high - low) / (2.0 * part)

    def _refuse_wrong(self, each: Input, points: Sequence[Reading], exact: Real, tried: Real) -> None:
        largest = dict[str, float]()
        for point, a, b in zip(points, exact, tried, strict=True):
            largest[point.series] = max(largest.get(point.series, 0.0), abs(a), abs(b))
        sizes = np.array([largest[point.series] + self.of.deviation(point) for point in points])
        off = np.abs(exact - tried) / sizes
        worst = int(np.argmax(off))
        if off[worst] > WRONG:
            point = points[worst]
            raise CaseError(
                f'{self.of.folder / MODEL}: derivatives: by "{each.name}" a deviation changes {point.series}, '
                f"{dict(point.conditions)}, by {exact[worst]:.4g}, and by differences by {tried[worst]:.4g}: correct "
                "it, or leave the input out, which is then differentiated by differences"
            )

    def _asked(
        self, function: Callable[..., Any], name: str, points: Sequence[Reading], inputs: Mapping[str, float],
        effort: int,
    ) -> Any:  # fmt: skip
        try:
            answer = function(tuple(points), dict(inputs), effort)
        except Exception as error:  # the file is anybody's
            where = f"{self.of.folder / MODEL}: {name} at effort {effort}"
            raise CaseError(f"{where}: {type(error).__name__}: {error}") from error
        self._done += 1
        self.listener(self._done, max(self._done, self.expected))
        return answer

    def _finite(self, answer: Any, what: str, points: Sequence[Reading]) -> Real:
        where = f"{self.of.folder / MODEL}: {what}"
        try:
            values = np.asarray(answer, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise CaseError(f"{where}: {type(error).__name__}: {error}") from error
        if values.shape != (len(points),):
            raise CaseError(f"{where} is an array {values.shape} for {len(points)} points")
        if not np.all(np.isfinite(values)):
            first = points[int(np.argmin(np.isfinite(values)))]
            raise CaseError(f"{where} for {first.series}, {dict(first.conditions)}, is no finite number")
        return values
