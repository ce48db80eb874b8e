"""Campbell diagrams: eigenvalues of steady spins against the spin rate, with modes tracked by their shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from flexmb.linear.equations import built
from flexmb.linear.linear_model import Complex, LinearModel, Stability, modal_assurance
from flexmb.linear.linearize import linear_model, looked_at
from flexmb.linear.spin import spun
from flexmb.linear.variations import Equations
from flexmb.output.files import whole_file
from flexmb.scene.schema import Scene
from flexmb.system.system import System
from flexmb.system.watches import warn
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.tables.state import State
from flexmb.typing import Real


@dataclass(frozen=True, eq=False)
class Campbell:
    """The modes of a system whose `hinge` spins steadily, in the frame of the rotating bodies.

    rates (R,) rad/s; eigenvalues (R,n) rad/s, column j is one mode tracked along the rates; mac (R,n): modal assurance
    criterion of its shape with that at the previous rate, 1 for equal shapes; names (n,): its dominant displacement at
    the first rate; stability: one verdict per rate.
    """

    scene: str
    hinge: str
    rates: Real
    eigenvalues: Complex
    mac: Real
    names: tuple[str, ...]
    stability: tuple[Stability, ...]

    __repr__ = brief

    def __post_init__(self) -> None:
        """TypeError or ValueError for parts that do not fit together."""
        self._refuse_torn()

    def _refuse_torn(self) -> None:
        size = len(self.stability), len(self.names)
        arguments.held("rates", self.rates, size[:1])
        arguments.held("eigenvalues", self.eigenvalues, size, "c")
        arguments.held("mac", self.mac, size)

    @property
    def frequencies_hz(self) -> Real:
        """(R,n) of the damped oscillations; 0 where a mode does not oscillate."""
        return self.eigenvalues.imag / (2.0 * np.pi)

    @property
    def unstable(self) -> NDArray[np.bool_]:
        """(R,) where the linear model is unstable."""
        return np.array([found.verdict == "unstable" for found in self.stability])

    def plot(self, path: Path | str, modes: int | None = None) -> Path:
        """Write the diagram as a picture: frequencies and growth rates of the lowest `modes`, by default of all."""
        from flexmb.linear.campbell_picture import write_campbell_plot  # loads matplotlib

        self._refuse_torn()
        shown = self.eigenvalues[:, : None if modes is None else arguments.count("modes", modes)]
        is_growing = shown.real > np.array([found.tolerance for found in self.stability])[:, None]
        return write_campbell_plot(Path(path), self.scene, self.hinge, self.rates, self.names, shown, is_growing)

    def to_csv(self, path: Path | str) -> Path:
        """Rates, and of every mode the frequency (Hz) and the growth rate (1/s), named as in `names`."""
        self._refuse_torn()
        columns = ["rate [rad/s]"]
        for number, name in enumerate(self.names, 1):
            columns += [f"{number} {name} frequency [Hz]", f"{number} {name} growth [1/s]"]
        pairs = np.stack([self.frequencies_hz, self.eigenvalues.real], axis=2).reshape(len(self.rates), -1)
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        table = np.column_stack([self.rates, pairs])
        with whole_file(path) as beside:
            np.savetxt(beside, table, fmt="%.17g", delimiter=",", header=",".join(columns), comments="")
        return path


def campbell(system: System | Scene, hinge: str, rates: ArrayLike) -> Campbell:
    """Eigenvalues against the spin rate (rad/s) of a revolute hinge or wheel, in the order of `rates`.

    The initial guess of every steady state is that of the previous rate. Warns (`SceneWarning`) as `steady_spin` does:
    where a body turns faster than its level describes, unstable may be the level, and not the machine. Raises what
    `steady_spin` raises.
    """
    if isinstance(system, Scene):
        system = built(system)
    rates = arguments.finite("rates", np.atleast_1d(arguments.array("rates", rates))).copy()
    if rates.ndim != 1 or not len(rates):
        raise ValueError(f"rates: give at least one, in a row, not an array of shape {rates.shape}")
    guess: State | None = None
    turning: list[tuple[Equations, State]] = []
    values: list[Complex] = []
    macs: list[Real] = []
    verdicts: list[Stability] = []
    names: tuple[str, ...] = ()
    before: tuple[LinearModel, Complex] | None = None
    for rate in rates:
        spin = spun(system, hinge, float(rate), guess)
        model, guess = linear_model(*spin.moving), spin.state
        turning.append(spin.moving)
        found, current = _spectrum(model)
        if before is None:
            names = tuple(_dominant(model, shape) for shape in current.T)
            macs.append(np.ones(len(found)))
        else:
            shapes = before[0].displacements_by(model.displacements) @ before[1]  # independent ones may differ
            alike = modal_assurance(model.mass, shapes, current)
            order = _followed(alike, values[-1], found)
            macs.append(alike[np.arange(len(order)), order])
            found, current = found[order], current[:, order]
        values.append(found)
        before = model, current
        verdicts.append(model.stability)
    warn(looked_at(turning))
    return Campbell(
        system.scene.name, hinge, rates, np.array(values), np.array(macs), names, tuple(verdicts)
    )  # fmt: skip


def _spectrum(model: LinearModel) -> tuple[Complex, Complex]:
    """n eigenvalues, one of each pair (with the larger imaginary, or else real part), and shapes (n,n)."""
    modes = [mode for mode in model.modes if mode.eigenvalue.imag > 0.0]
    real = sorted(
        (mode for mode in model.modes if mode.eigenvalue.imag == 0.0), key=lambda mode: -mode.eigenvalue.real
    )
    modes += real[: len(model.rates) - len(modes)]
    modes.sort(key=lambda mode: mode.natural_rad_s)
    return np.array([mode.eigenvalue for mode in modes]), np.array([mode.shape for mode in modes]).T


def _dominant(model: LinearModel, shape: Complex) -> str:
    return model.displacements[int(np.argmax(np.abs(shape)))]


def _followed(alike: Real, before: Sequence[complex] | Complex, after: Complex) -> NDArray[np.int64]:
    """For each mode at the previous rate its index at this one, one to one: by shape, and by frequency if shapes mix.
    """
    a, b = np.asarray(before)[:, None], after[None]
    apart = np.abs(a - b) / np.maximum(np.abs(a) + np.abs(b), np.finfo(float).tiny)
    return linear_sum_assignment(1.0 - alike + apart)[1]
