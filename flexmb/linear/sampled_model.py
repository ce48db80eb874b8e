"""The linear model of a sampled loop over one period: matrices by name, multipliers, stability, opened loops."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from flexmb.kept import kept
from flexmb.linear.linear_model import Complex, control_names, decomposed, save_matrices
from flexmb.linear.margins import LoopTransfer
from flexmb.linear.sampled_loop import Cut, LiftedLoop
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.tables.state import State
from flexmb.typing import Real

MOVING = 1e-9  # part of the largest entry of an eigenvector, below which a displacement does not move in it


@dataclass(frozen=True, eq=False)
class SampledMode:
    """One multiplier: the factor on a motion in a period (s); of a conjugate pair the one with positive imaginary part.

    tolerance: its uncertainty from rounding of A. shape (x,): states, largest entry 1. dominant: the displacement with
    the largest part of the kinetic energy, or where none moves the largest state.
    """

    multiplier: complex
    tolerance: float
    period: float
    shape: Complex
    dominant: str

    def __str__(self) -> str:
        size = abs(self.multiplier)
        if self.multiplier.imag == 0.0:
            return f"multiplier {self.multiplier.real:.6g} ({self.dominant})"
        of = f"{self.frequency_hz:.6g} Hz, damping ratio {self.damping_ratio:.3g}"
        return f"multiplier of size {size:.6g}, {of} ({self.dominant})"

    @property
    def frequency_rad_s(self) -> float:
        """Frequency, up to half of that of the periods; what is faster looks slower."""
        return float(np.angle(self.multiplier)) / self.period

    @property
    def frequency_hz(self) -> float:
        """The same in Hz."""
        return self.frequency_rad_s / (2.0 * np.pi)

    @property
    def rate(self) -> complex:
        """The eigenvalue (rad/s) of the continuous motion that it samples: its logarithm over the period."""
        return complex(np.log(self.multiplier) / self.period) if self.multiplier else complex(-np.inf)

    @property
    def damping_ratio(self) -> float:
        """Of that motion; 1 for what is gone after a period, NaN for what stays."""
        if not self.multiplier:
            return 1.0
        size = abs(self.rate)
        return -self.rate.real / size if size * self.period > self.tolerance else np.nan


@dataclass(frozen=True)
class SampledStability:
    """Verdict of the multipliers, up to rounding; `multiplier` is the one that decides, known to `tolerance`.

    "neutral": no multiplier is outside the unit circle beyond rounding, but some are on it.
    """

    verdict: Literal["asymptotically stable", "neutral", "unstable"]
    multiplier: complex
    tolerance: float

    def __str__(self) -> str:
        return f"{self.verdict}: largest multiplier {abs(self.multiplier):.9g}, known to {self.tolerance:.1g}"


@dataclass(frozen=True, eq=False)
class SampledModel:
    """x(t + T) = A x + B i and y = C x + D i about `state`, with the period T (s) after which all controllers repeat.

    x are deviations at an instant of the first sampled controller, before it acts: those of a `LinearModel` of the loop
    between instants, the states of sampled controllers ("law.state[0]"), and outputs that wait for their delay
    ("law.delayed[1][0]", computed one sample ago). Among the former are the outputs that are held. What no later value
    depends on is left out. Inputs: loads as of a `LinearModel`, held for a period, and what is added to sensors'
    signals where sampled controllers read them. Outputs are those of a `LinearModel`, then of all controllers, just
    after the controllers have acted, as in the rows of a run; a row is NaN where redundant closures leave it open.

    mass (n,n): mass matrix of the displacements, the first n of x. rates (n,): accelerations at `state` with the
    outputs in force, zero in an equilibrium. free: states that drift, because nothing resists and no controller reads
    them: wheel angles, or the position of a satellite; their multipliers are 1, and are left out. saturated:
    controllers at a limit, which no small motion changes. loop, loop_signals: of which `opened` makes transfer
    functions; a model that is made by `dataclasses.replace` has those of the first.
    """

    scene: str
    state: State
    period: float
    states: tuple[tuple[str, str], ...]
    inputs: tuple[tuple[str, str], ...]
    outputs: tuple[tuple[str, str], ...]
    A: Real
    B: Real
    C: Real
    D: Real
    mass: Real
    rates: Real
    free: tuple[str, ...]
    saturated: tuple[str, ...]
    loop: LiftedLoop
    loop_signals: dict[str, Cut]

    __repr__ = brief

    def __post_init__(self) -> None:
        """TypeError or ValueError for parts that do not fit together. Arrays are copied and read-only."""
        own = {name: np.array(getattr(self, name), float) for name in self._refuse_torn()}
        for name in ("A", "B", "mass", "rates"):
            arguments.finite(name, own[name])
        for array in own.values():
            array.setflags(write=False)
        self.__dict__.update(own)

    def _refuse_torn(self) -> Iterable[str]:
        if not isinstance(self.state, State):
            raise TypeError(f"state is a {type(self.state).__name__}: give a State")
        if not arguments.number("period", self.period) > 0.0:
            raise ValueError(f"period: {self.period:g} s is no period: give a positive one")
        arguments.held("rates", self.rates, (None,))
        x, i, y, n = len(self.states), len(self.inputs), len(self.outputs), len(self.rates)
        shapes = {"A": (x, x), "B": (x, i), "C": (y, x), "D": (y, i), "mass": (n, n), "rates": (n,)}
        for name, shape in shapes.items():
            arguments.held(name, getattr(self, name), shape)
        return shapes

    @kept
    def modes(self) -> tuple[SampledMode, ...]:
        """One for each conjugate pair of multipliers and each real one, the largest first, without those of `free`."""
        values, vectors, tolerances = self._decomposition
        names, n = [name for name, _ in self.states], len(self.rates)
        found = list[SampledMode]()
        for value, vector, tolerance in zip(values, vectors.T, tolerances, strict=True):
            if value.imag < 0.0:
                continue
            shape = np.zeros(len(names), complex)
            shape[self._bound] = vector / vector[np.argmax(np.abs(vector))]
            energy = np.abs(shape[:n]) ** 2 * np.diag(self.mass)
            still = np.max(np.abs(shape[:n]), initial=0.0) <= MOVING
            dominant = names[int(np.argmax(np.abs(shape) if still else energy))]
            found.append(SampledMode(complex(value), float(tolerance), self.period, shape, dominant))
        return tuple(found)

    @kept
    def multipliers(self) -> Complex:
        """Eigenvalues of A, the largest first, without those of `free`."""
        return self._decomposition[0]

    @property
    def stability(self) -> SampledStability:
        """Verdict by the multipliers and how well each of them is known."""
        values, _, tolerances = self._decomposition
        if not len(values):
            return SampledStability("asymptotically stable", 0j, 0.0)
        worst = int(np.argmax(np.abs(values) - tolerances))
        if abs(values[worst]) - tolerances[worst] > 1.0:
            return SampledStability("unstable", complex(values[worst]), float(tolerances[worst]))
        worst = int(np.argmax(np.abs(values) + tolerances))
        inside = abs(values[worst]) + tolerances[worst] < 1.0
        verdict: Literal["asymptotically stable", "neutral"] = "asymptotically stable" if inside else "neutral"
        return SampledStability(verdict, complex(values[worst]), float(tolerances[worst]))

    @property
    def stable(self) -> bool:
        """Whether all multipliers are inside the unit circle, beyond rounding."""
        return self.stability.verdict == "asymptotically stable"

    @property
    def loop_names(self) -> tuple[str, ...]:
        """Where the loop can be opened: outputs of sampled controllers, and sensors that only these read."""
        return tuple(self.loop_signals)

    def opened(self, signal: str) -> LoopTransfer:
        """The transfer function of the loop that is opened at one signal, all other loops being closed.

        KeyError for a name that is not in `loop_names`, ValueError for a signal that is sampled more than once in a
        period, of which there is no one transfer function.
        """
        self._refuse_torn()
        if signal not in self.loop_signals:
            raise KeyError(f"no loop goes through {signal!r}; there are {', '.join(self.loop_signals)}")
        try:
            lifted = self.loop.lifted(self.period, self.loop_signals[signal])
        except ValueError as error:
            raise ValueError(f'signal "{signal}": {error}') from None
        row, column = len(lifted.C) - 1, lifted.B.shape[1] - 1
        keep = np.flatnonzero(lifted.read)
        return LoopTransfer(
            signal, self.period, lifted.A[np.ix_(keep, keep)], lifted.B[keep, column], -lifted.C[row, keep],
            -float(lifted.D[row, column]), self.multipliers,
        )  # fmt: skip

    def plot(self, path: Path | str, signal: str | None = None) -> Path:
        """Write a picture of a loop opened at a signal, Bode and Nyquist diagrams and multipliers; `opened` has them.

        By default it is the first signal whose loop has a transfer function.
        """
        from flexmb.linear.sampled_picture import write_loop_plot  # loads matplotlib

        self._refuse_torn()
        if not self.loop_signals:
            raise ValueError("no controller of the scene is sampled: there is no loop to draw")
        shown = self._first_opened() if signal is None else self.opened(signal)
        return write_loop_plot(Path(path), self.scene, shown)

    def to_control(self) -> Any:
        """As a named `control.StateSpace` with dt, with ":" for "." in names of inputs and outputs.

        ImportError where python-control is not installed.
        """
        try:
            import control
        except ImportError:
            raise ImportError("python-control is not installed: pip install control, or use A, B, C and D") from None
        self._refuse_torn()
        names = control_names(self.states, self.inputs, self.outputs)
        return control.ss(self.A, self.B, self.C, self.D, self.period, **names)

    def save(self, path: Path | str) -> Path:
        """Matrices, period, names, units and multipliers as `.npz` or `.mat`; ValueError for another ending."""
        self._refuse_torn()
        data: dict[str, Any] = {key: getattr(self, key) for key in ("A", "B", "C", "D", "mass", "multipliers")}
        data["period"] = np.array(self.period)
        return save_matrices(path, data, {key: getattr(self, key) for key in ("states", "inputs", "outputs")})

    def _first_opened(self) -> LoopTransfer:
        for name in self.loop_names[:-1]:
            with suppress(ValueError):
                return self.opened(name)
        return self.opened(self.loop_names[-1])

    @property
    def _bound(self) -> list[int]:
        """Places of the states that are not free."""
        return [i for i, (name, _) in enumerate(self.states) if name not in self.free]

    @kept
    def _decomposition(self) -> tuple[Complex, Complex, Real]:
        """Multipliers, the largest first, their vectors among the states that are not free, and tolerances."""
        self._refuse_torn()
        bound = self._bound
        if not bound:
            return np.zeros(0, complex), np.zeros((0, 0), complex), np.zeros(0)
        values, vectors, tolerances = decomposed(self.A[np.ix_(bound, bound)])
        order = np.lexsort((-values.imag, -np.abs(values)))
        return values[order], vectors[:, order], tolerances[order]
