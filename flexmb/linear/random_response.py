"""Random vibration of a linear model: spectral densities of its inputs, spectral densities and RMS of its outputs.

    S_y(f) = sum over inputs |H_yi(2 pi f)|^2 S_i(f)        rms_y^2 = integral of S_y over f

with the frequency responses H and one-sided densities S_i of inputs that are not correlated. Nothing is assumed of the
modes: H is the response of the whole model, with its damping, gyroscopic terms and controllers as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import quad_vec

from flexmb.linear.linear_model import LinearModel, harmonic, place
from flexmb.output.files import as_text, whole_file
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.typing import Flags, Real

STANDARD_GRAVITY = 9.80665
"""m/s^2 in a g."""
RELATIVE = 1e-9
"""Of a mean square, to which it is integrated."""
MOST_ERROR = 1e-6
"""Of a mean square: what is known less well, because intervals have run out, is refused rather than told."""
_ROUGHLY = (0.1, 0.01)
MOST_INTERVALS = 20_000
"""Of one integral: half a minute for a model of a hundred states."""
STILL = 1e-9
"""Of the largest RMS in the same unit, below which a response consists of rounding errors."""
_SHOWN = 400  # frequencies of a picture or table, beside those about resonances
# Half bandwidths from a resonance at which the integral is divided beforehand, so that none is passed over.
_AROUND = (0.0, 1.0, 6.0, 40.0)


@dataclass(frozen=True, eq=False)
class SpectralDensity:
    """A one-sided power spectral density: straight lines in logarithmic scales between points, zero outside.

    frequencies_hz (F,) ascending and positive; values (F,), the square of the input's unit per Hz, positive. ValueError
    or TypeError for others.
    """

    frequencies_hz: Real
    values: Real

    __repr__ = brief

    def __post_init__(self) -> None:
        f = arguments.finite("frequencies_hz", arguments.array("frequencies_hz", self.frequencies_hz)).copy()
        s = arguments.finite("values", arguments.array("values", self.values)).copy()
        if f.ndim != 1 or f.shape != s.shape or len(f) < 2:
            raise ValueError(
                f"a spectral density needs two points at least, with a value each; not {f.shape}, {s.shape}"
            )
        if not (f[0] > 0.0 and np.all(np.diff(f) > 0.0)):
            raise ValueError("frequencies of a spectral density are positive and ascend")
        if not np.all(s > 0.0):
            raise ValueError("values of a spectral density are positive; it is zero outside its points")
        for name, array in (("frequencies_hz", f), ("values", s)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @classmethod
    def of(cls, points: SpectralDensity | ArrayLike) -> SpectralDensity:
        """The density through points (F,2) of frequency (Hz) and value."""
        if isinstance(points, SpectralDensity):
            return points
        pairs = arguments.array("points", points)
        if pairs.ndim != 2 or pairs.shape[1] != 2:
            raise ValueError(f"a spectral density is given by pairs (frequency in Hz, value), not by {pairs.shape}")
        return cls(pairs[:, 0], pairs[:, 1])

    @classmethod
    def in_g(cls, points: ArrayLike) -> SpectralDensity:
        """The density of an acceleration through points (F,2) of frequency (Hz) and value (g^2/Hz)."""
        own = cls.of(points)
        return cls(own.frequencies_hz, own.values * STANDARD_GRAVITY**2)

    def at(self, frequencies_hz: ArrayLike) -> Real:
        """Values at frequencies (...) in Hz."""
        f = arguments.finite("frequencies_hz", arguments.array("frequencies_hz", frequencies_hz))
        own = np.log(self.frequencies_hz)
        inside = (f >= self.frequencies_hz[0]) & (f <= self.frequencies_hz[-1])
        return np.where(inside, np.exp(np.interp(np.log(np.where(inside, f, 1.0)), own, np.log(self.values))), 0.0)

    @property
    def rms(self) -> float:
        """The root mean square of the input, in closed form: of each line, f1 s1 (r^(m+1) - 1) / (m + 1)."""
        f, s = self.frequencies_hz, self.values
        widths = np.log(f[1:] / f[:-1])
        x = np.log(s[1:] / s[:-1]) + widths  # (m + 1) log r
        grown = np.where(np.abs(x) < 1e-12, 1.0, np.expm1(x) / np.where(x == 0.0, 1.0, x))
        return float(np.sqrt(np.sum(f[:-1] * s[:-1] * widths * grown)))


@dataclass(frozen=True, eq=False)
class RandomResponse:
    """The response of a linear model to stationary random inputs that are not correlated.

    outputs: names and units; rms (K,) and the error (K,) of its integration; crossings_hz (K,): how often a second the
    signal rises through its mean, from the second moment of its density. NaN for loads that are not determined.
    inputs: the densities by the names of the inputs.
    """

    model: LinearModel
    inputs: Mapping[str, SpectralDensity]
    outputs: tuple[tuple[str, str], ...]
    rms: Real
    error: Real
    crossings_hz: Real

    __repr__ = brief

    @property
    def moves(self) -> Flags:
        """(K,) which outputs move more than rounding does, beside the largest RMS in the same unit; also those that are
        undetermined."""
        sizes = np.nan_to_num(self.rms)
        return np.isnan(self.rms) | (sizes > STILL * most_of([unit for _, unit in self.outputs], sizes))

    def __getitem__(self, output: str) -> float:
        """The RMS of an output; KeyError if there is none of this name."""
        return float(self.rms[place(self.outputs, output, "output")])

    def density(self, frequencies_hz: ArrayLike) -> Real:
        """(F,K) one-sided spectral densities, the square of the output's unit per Hz, at frequencies (F,) in Hz."""
        f = arguments.finite("frequencies_hz", np.atleast_1d(arguments.array("frequencies_hz", frequencies_hz)))
        names = tuple(name for name, _ in self.outputs)
        total = np.zeros((len(f), len(names)))
        for name, density in self.inputs.items():
            inside = density.at(f)
            used = inside > 0.0
            response = self.model.frequency_response(name, 2.0 * np.pi * f[used], names)
            total[used] += np.abs(response) ** 2 * inside[used, None]
        return total

    @property
    def frequencies_hz(self) -> Real:
        """Frequencies (F,) that show the densities: in equal ratios over the band, and more about the resonances."""
        low, high = band(self.inputs)
        near = resonances(self.model, low, high)
        return np.unique(np.concatenate([np.geomspace(low, high, _SHOWN), near]))

    def plot(self, path: Path | str) -> Path:
        """Write the densities as a picture, one diagram for each unit, with the RMS of each output."""
        from flexmb.linear.vibration_picture import write_density_plot  # loads matplotlib

        f, shown = self.frequencies_hz, self.moves & np.isfinite(self.rms)
        outputs = [output for output, is_shown in zip(self.outputs, shown, strict=True) if is_shown]
        return write_density_plot(Path(path), self.model.scene, f, self.density(f)[:, shown], outputs, self.rms[shown])

    def to_csv(self, path: Path | str) -> Path:
        """Frequencies (Hz) and the densities of all outputs."""
        f = self.frequencies_hz
        names = ["frequency [Hz]", *(as_text(f"{name} [({unit})^2/Hz]") for name, unit in self.outputs)]
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as beside:
            table = np.column_stack([f, self.density(f)])
            np.savetxt(beside, table, fmt="%.17g", delimiter=",", header=",".join(names), comments="")
        return path


def band(inputs: Mapping[str, SpectralDensity]) -> tuple[float, float]:
    """The lowest and the highest frequency (Hz) of the densities."""
    return (
        min(float(density.frequencies_hz[0]) for density in inputs.values()),
        max(float(density.frequencies_hz[-1]) for density in inputs.values()),
    )


def resonances(model: LinearModel, low: float, high: float) -> Real:
    """Frequencies (Hz) at and about the resonances between two frequencies, ascending."""
    at = [
        abs(mode.eigenvalue.imag) + sign * times * abs(mode.eigenvalue.real)
        for mode in model.modes if not mode.is_rigid_body
        for times in _AROUND for sign in (-1.0, 1.0)
    ]  # fmt: skip
    f = np.unique(np.array(at) / (2.0 * np.pi))
    return f[(f > low) & (f < high)]


def random_response(
    model: LinearModel, densities: Mapping[str, SpectralDensity | ArrayLike], outputs: tuple[str, ...] = ()
) -> RandomResponse:
    """Response of all, or the named, outputs to stationary random inputs that are not correlated.

    densities: for inputs by their names a `SpectralDensity`, or its points (F,2) of frequency (Hz) and one-sided
    density (the square of the input's unit per Hz). S_y = sum |H|^2 S, with all modes; mean squares are integrated to
    1e-9, divided at every resonance. KeyError for names that do not exist, ValueError for densities that are not
    positive, for an unstable model, and for a mode without damping inside the band, TypeError for no linear model,
    ArithmeticError where a mean square is not known to 1e-6.
    """
    if not isinstance(model, LinearModel):
        raise TypeError(f"a LinearModel is needed, not {type(model).__name__}: see linearize and base_excitation")
    if not isinstance(densities, Mapping) or not densities:
        raise ValueError("give a spectral density for one input at least: {input: [(frequency_hz, value), ...]}")
    inputs = {name: SpectralDensity.of(density) for name, density in densities.items()}
    columns = [place(model.inputs, name, "input") for name in inputs]
    chosen = outputs or tuple(name for name, _ in model.outputs)
    rows = [place(model.outputs, name, "output") for name in chosen]
    low, high = band(inputs)
    _refuse_endless(model, low, high)
    determined = ~np.isnan(np.hstack([model.C, model.D])[rows]).any(axis=1)
    used, levels = np.array(rows)[determined].tolist(), list(inputs.values())

    def moments(log_f: float) -> Real:
        f = float(np.exp(log_f))
        response = np.abs(harmonic(model, 2.0 * np.pi * f, columns, used)) ** 2
        density = f * (response @ np.array([level.at(f) for level in levels]))
        return np.concatenate([density, f**2 * density])

    corners = np.concatenate([*(level.frequencies_hz for level in levels), resonances(model, low, high)])
    knots = np.unique(np.log(corners))
    size, units = np.ones(2 * len(used)), [model.outputs[row][1] for row in used]
    integral = error = np.zeros(2 * len(used))
    # In the scale of what was found before, so that all come to the same share.
    for share in (*_ROUGHLY, RELATIVE) if used else ():
        found = quad_vec(
            partial(_scaled, moments, size), knots[0], knots[-1], points=knots[1:-1], norm="max", epsabs=0.0,
            epsrel=share, limit=MOST_INTERVALS,
        )  # fmt: skip
        integral, error = found[0] * size, float(found[1]) * size
        size = np.maximum(integral, np.tile(STILL**2 * most_of(units, integral[: len(used)]), 2))
        size[size == 0.0] = 1.0
    if used and not float(found[1]) <= MOST_ERROR:
        raise ArithmeticError(
            f"the mean squares are known to {float(found[1]):.1e} only after {MOST_INTERVALS} intervals: narrow the "
            "band of the densities, or ask for fewer outputs at once"
        )
    rms, doubt, crossings = (np.full(len(rows), np.nan) for _ in range(3))
    square, second = integral[: len(used)], integral[len(used) :]
    rms[determined] = np.sqrt(square)
    with np.errstate(invalid="ignore", divide="ignore"):
        doubt[determined] = np.where(square > 0.0, 0.5 * error[: len(used)] / np.sqrt(square), 0.0)
        crossings[determined] = np.where(square > 0.0, np.sqrt(second / square), 0.0)
    return RandomResponse(model, inputs, tuple(model.outputs[row] for row in rows), rms, doubt, crossings)


def most_of(units: Sequence[str], sizes: Real) -> Real:
    """(K,) for each output the largest size (K,) of all in the same unit."""
    most = dict[str, float]()
    for unit, size in zip(units, sizes.tolist(), strict=True):
        most[unit] = max(most.get(unit, 0.0), size)
    return np.array([most[unit] for unit in units])


def _scaled(moments: Callable[[float], Real], size: Real, log_f: float) -> Real:
    return moments(log_f) / size


def _refuse_endless(model: LinearModel, low: float, high: float) -> None:
    """ValueError for a model whose motion is not stationary in the band: it is unstable, or a mode has no damping."""
    stability = model.stability
    if stability.verdict == "unstable":
        raise ValueError(f"no response is stationary about this state: {stability}")
    for mode in model.modes:
        free = not mode.is_rigid_body and abs(mode.eigenvalue.real) <= mode.tolerance
        if free and low <= mode.frequency_hz <= high:
            raise ValueError(
                f"the mode at {mode.frequency_hz:.6g} Hz has no damping, so that its response grows for ever: give its "
                "bodies a damping_ratio or viscosity_s, its hinges and connectors dampers, or leave its frequency out "
                "of the densities"
            )
