"""A linear model of a system about one state: matrices by name, modes, stability, frequency response, export."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eig, matrix_balance

from flexmb.kept import kept
from flexmb.output.files import whole_file
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.tables.soundness import unsound
from flexmb.tables.state import NO_QUATERNIONS, State
from flexmb.typing import Real

Complex = NDArray[np.complex128]
ROUNDOFF = 2.0**-53
NOT_ANOTHER = 1e-4  # shapes of a defective double eigenvalue agree to about the root of rounding; others do not


@dataclass(frozen=True, eq=False)
class Mode:
    """One eigenvalue (rad/s); of a conjugate pair the one with positive imaginary part.

    shape (n,): displacements, largest entry 1. tolerance (rad/s): uncertainty of the eigenvalue from rounding of A.
    participation (n,): part of the kinetic energy in each displacement, by the diagonal of the mass matrix.
    """

    eigenvalue: complex
    shape: Complex
    tolerance: float
    participation: Real

    def __str__(self) -> str:
        if self.is_rigid_body:
            return "rigid-body motion"
        if self.eigenvalue.imag == 0.0:
            return f"no oscillation, {self.eigenvalue.real:.6g} 1/s"
        ratio = self.damping_ratio if abs(self.eigenvalue.real) > self.tolerance else 0.0
        return f"{self.frequency_hz:.6g} Hz, damping ratio {ratio:.3g}"

    @property
    def is_rigid_body(self) -> bool:
        """Whether the eigenvalue is zero within its tolerance: no stiffness, drive or damping acts on the motion."""
        return abs(self.eigenvalue) <= self.tolerance

    @property
    def natural_rad_s(self) -> float:
        """Modulus of the eigenvalue."""
        return abs(self.eigenvalue)

    @property
    def frequency_rad_s(self) -> float:
        """Frequency of the damped oscillation; 0 for a real eigenvalue."""
        return self.eigenvalue.imag

    @property
    def frequency_hz(self) -> float:
        """The same in Hz."""
        return self.eigenvalue.imag / (2.0 * np.pi)

    @property
    def damping_ratio(self) -> float:
        """Real part over modulus, with the opposite sign; NaN for an eigenvalue that is zero."""
        return -self.eigenvalue.real / abs(self.eigenvalue) if abs(self.eigenvalue) > self.tolerance else np.nan


@dataclass(frozen=True)
class Stability:
    """Verdict of the eigenvalues, up to rounding; `eigenvalue` is the one that decides, known to `tolerance` (rad/s).

    "neutral": no eigenvalue has a positive real part beyond rounding, but some real parts are zero; then nonlinear
    terms decide.
    """

    verdict: Literal["asymptotically stable", "neutral", "unstable"]
    eigenvalue: complex
    tolerance: float

    def __str__(self) -> str:
        text = f"largest real part {self.eigenvalue.real:.6g} rad/s, known to {self.tolerance:.1g}"
        return f"{self.verdict}: {text}"


@dataclass(frozen=True, eq=False)
class LinearModel:
    """x' = A x + B f, y = C x + D f about `state`, x = [xi; du]: displacements (n,) and changes of the speeds (n,).

    Names and units: `states` (2n), `inputs` (loads of hinges and wheels along their free speeds), `outputs` (the
    states, then displacement and rotation vector of every marker, World axes, then what sensors say). mass (n,n): mass
    matrix. motion (nq,n): dq = motion xi. rates (n,): udot at `state`, zero in an equilibrium; drift (n,): its explicit
    derivative by time. A row of C and D is NaN, as a whole, where a sensor reads a load that redundant closures leave
    undetermined.

    For a closed chain the states are the independent coordinates and their speeds. The dependent ones follow the states
    among the outputs, and `motion` includes both.

    Arrays are copied and read-only, because eigenvalues are computed once: use `dataclasses.replace(model, A=...)` for
    a changed model. TypeError or ValueError for parts that do not fit together.
    """

    scene: str
    state: State
    states: tuple[tuple[str, str], ...]
    inputs: tuple[tuple[str, str], ...]
    outputs: tuple[tuple[str, str], ...]
    A: Real
    B: Real
    C: Real
    D: Real
    mass: Real
    motion: Real
    rates: Real
    drift: Real

    __repr__ = brief

    def __post_init__(self) -> None:
        own = {name: np.array(getattr(self, name), float) for name in self._refuse_torn()}
        if any(unsound(array.ravel(), NO_QUATERNIONS) for array in own.values()):
            # The row of an undetermined output is NaN as a whole: a NaN beside numbers is a fault.
            determined = ~np.all(np.isnan(np.hstack([own["C"], own["D"]])), 1)
            for name, array in own.items():
                arguments.finite(name, np.where(determined[:, None], array, 0.0) if name in "CD" else array)
        for array in own.values():
            array.setflags(write=False)
        self.__dict__.update(own)

    def _refuse_torn(self) -> Iterable[str]:
        """The names of all arrays; TypeError or ValueError if the parts do not fit together."""
        if not isinstance(self.state, State):
            raise TypeError(f"state is a {type(self.state).__name__}: give a State")
        arguments.held("rates", self.rates, (None,))
        x, f, y = len(self.states), len(self.inputs), len(self.outputs)
        n, nq = len(self.rates), len(self.state.kernel_q)
        shapes = {
            "A": (x, x), "B": (x, f), "C": (y, x), "D": (y, f), "mass": (n, n), "motion": (nq, n), "rates": (n,),
            "drift": (n,),
        }  # fmt: skip
        for name, shape in shapes.items():
            arguments.held(name, getattr(self, name), shape)
        return shapes

    @property
    def displacements(self) -> tuple[str, ...]:
        """Names of the first half of x."""
        return tuple(name for name, _ in self.states[: len(self.rates)])

    def displacements_by(self, names: Sequence[str]) -> Real:
        """(len(names), n) displacements with these names, also dependent ones, by x[:n]; KeyError for other names."""
        self._refuse_torn()
        return self.C[[place(self.outputs, name, "output") for name in names], : len(self.rates)]

    @kept
    def eigenvalues(self) -> Complex:
        """All 2n eigenvalues (rad/s), by modulus."""
        return self._decomposition[0]

    @kept
    def modes(self) -> tuple[Mode, ...]:
        """One mode for each conjugate pair and for each real eigenvalue, by modulus."""
        values, vectors, tolerances = self._decomposition
        n, found = len(self.rates), []
        for value, vector, tolerance in zip(values, vectors.T, tolerances, strict=True):
            if value.imag >= 0.0:
                shape = vector[:n] / vector[:n][np.argmax(np.abs(vector[:n]))]
                energy = np.abs(shape) ** 2 * np.diag(self.mass)
                found.append(Mode(complex(value), shape, float(tolerance), energy / np.sum(energy)))
        return tuple(found)

    @kept
    def rigid_body_shapes(self) -> Real:
        """(n,r) orthonormal displacements of all zero eigenvalues, on which no stiffness acts.

        A motion without damping has two zero eigenvalues, one that a damper stops has one.
        """
        shapes = [mode.shape for mode in self.modes if mode.is_rigid_body]
        if not shapes:
            return np.zeros((len(self.rates), 0))
        columns = np.array([part for shape in shapes for part in (shape.real, shape.imag)]).T
        basis, size, _ = np.linalg.svd(columns, full_matrices=False)
        return basis[:, size > NOT_ANOTHER * size[0]]

    @property
    def stability(self) -> Stability:
        """Verdict by the eigenvalues and how well each of them is known."""
        values, _, tolerances = self._decomposition
        worst = int(np.argmax(values.real - tolerances))
        if values[worst].real > tolerances[worst]:
            return Stability("unstable", complex(values[worst]), float(tolerances[worst]))
        worst = int(np.argmax(values.real + tolerances))
        verdict = "asymptotically stable" if values[worst].real < -tolerances[worst] else "neutral"
        return Stability(verdict, complex(values[worst]), float(tolerances[worst]))  # type: ignore[arg-type]

    def frequency_response(self, input: str, omega: ArrayLike, outputs: tuple[str, ...] = ()) -> Complex:
        """Response (W, outputs) of all, or the named, outputs to a unit harmonic load at each omega (rad/s).

        y = C x + D f with (i omega - A) x = B f solved at each frequency: no modes are left out. KeyError for names
        that do not exist, ValueError at an undamped resonance and for frequencies that are not finite, TypeError for
        anything that is not a number.
        """
        self._refuse_torn()
        column = place(self.inputs, input, "input")
        rows = [place(self.outputs, name, "output") for name in outputs] or list(range(len(self.outputs)))
        frequencies = arguments.finite("omega", np.atleast_1d(arguments.array("omega", omega)))
        if frequencies.ndim != 1:
            raise ValueError(f"omega: give frequencies in a row, not an array of shape {frequencies.shape}")
        out = np.empty((len(frequencies), len(rows)), complex)
        for i, frequency in enumerate(frequencies):
            out[i] = harmonic(self, float(frequency), [column], rows)[:, 0]
        return out

    def marker_shape(self, mode: Mode, marker: str) -> Complex:
        """Displacement and rotation vector (6,) of a marker, World axes, in a mode as `Mode.shape` scales it."""
        shape, first = self._shape(mode), place(self.outputs, f"{marker}.x", "output")
        return self.C[first : first + 6, : len(self.rates)] @ shape

    def displaced(self, mode: Mode, size: float, phase: float = 0.0) -> State:
        """The state displaced along a mode, its largest displacement `size` (rad, m), for display; `phase` in rad."""
        size, phase = arguments.number("size", size), arguments.number("phase", phase)
        xi = np.real(self._shape(mode) * size * np.exp(1j * phase))
        return replace(self.state, q=self.state.q + self.motion @ xi)

    def to_scipy(self) -> Any:
        """As `scipy.signal.StateSpace`."""
        from scipy.signal import StateSpace

        self._refuse_torn()
        return StateSpace(self.A, self.B, self.C, self.D)

    def to_control(self) -> Any:
        """As a named `control.StateSpace`, with ":" for "." in names of inputs and outputs, where it allows none.

        ImportError where python-control is not installed.
        """
        try:
            import control
        except ImportError:
            raise ImportError("python-control is not installed: pip install control, or use to_scipy()") from None
        self._refuse_torn()
        return control.ss(self.A, self.B, self.C, self.D, **control_names(self.states, self.inputs, self.outputs))

    def save(self, path: Path | str) -> Path:
        """Matrices, names, units and eigenvalues as `.npz` or `.mat`; ValueError for another ending."""
        self._refuse_torn()
        data: dict[str, Any] = {key: getattr(self, key) for key in ("A", "B", "C", "D", "mass", "eigenvalues")}
        return save_matrices(path, data, {key: getattr(self, key) for key in ("states", "inputs", "outputs")})

    def _shape(self, mode: Mode) -> Complex:
        if not isinstance(mode, Mode):
            raise TypeError(f"a Mode of this model is needed, not {type(mode).__name__}: see `modes`")
        self._refuse_torn()
        arguments.held("the shape of the mode", mode.shape, (None,), "iufc")
        if mode.shape.shape != self.rates.shape:
            raise ValueError(f"the mode has {len(mode.shape)} displacements, this model {len(self.rates)}")
        if not np.isfinite(mode.shape).all():
            raise ValueError("the shape of the mode is not finite: give one of `modes`")
        return mode.shape

    @kept
    def _decomposition(self) -> tuple[Complex, Complex, Real]:
        """See `decomposed`, by modulus."""
        self._refuse_torn()
        values, vectors, tolerances = decomposed(self.A)
        order = np.lexsort((-values.imag, np.abs(values)))
        return values[order], vectors[:, order], tolerances[order]


def decomposed(A: Real) -> tuple[Complex, Complex, Real]:
    """Eigenvalues (n,), right eigenvectors (n,n), and bounds n u |A| / |y'x| (n,) of their changes from rounding of A.

    A is first balanced by powers of two, hence without rounding, because its entries differ by squares of frequencies.
    """
    balanced, (scale, _) = matrix_balance(A, permute=False, separate=1)
    values, left, right = eig(balanced, left=True, right=True)
    overlap = np.abs(np.sum(left.conj() * right, axis=0))
    size = len(values) * ROUNDOFF * np.linalg.norm(balanced, 2)
    return values, scale[:, None] * right, size / np.maximum(overlap, np.sqrt(ROUNDOFF))


Names = tuple[tuple[str, str], ...]
"""With units."""


def control_names(states: Names, inputs: Names, outputs: Names) -> dict[str, list[str]]:
    """Names as python-control takes them: without dots, but for those of states."""
    found = {"states": [name for name, _ in states]}
    return found | {
        key: [name.replace(".", ":") for name, _ in names] for key, names in (("inputs", inputs), ("outputs", outputs))
    }


def save_matrices(path: Path | str, data: dict[str, Any], named: dict[str, Names]) -> Path:
    """Write arrays, and names with units, as `.npz` or `.mat`; ValueError for another ending."""
    path = Path(path)
    data |= {key: np.array([f"{name} [{unit}]" for name, unit in names], dtype=np.str_) for key, names in named.items()}
    if path.suffix not in (".npz", ".mat"):
        raise ValueError(f"{path}: linear models are written as .npz or .mat")
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as beside:
        if path.suffix == ".npz":
            np.savez(beside, **data)
        else:
            from scipy.io import savemat

            cells = {key: value.astype(object) for key, value in data.items() if value.dtype.kind == "U"}
            savemat(beside, data | cells)
    return path


def modal_assurance(mass: Real, one: Complex, other: Complex) -> Real:
    """Modal assurance criterion (j,k) of shapes (n,j) with shapes (n,k), by kinetic energy: 1 for equal shapes."""
    root = np.linalg.cholesky(mass).T
    a, b = (x / np.linalg.norm(x, axis=0) for x in (root @ one, root @ other))
    return np.abs(a.conj().T @ b) ** 2


def harmonic(model: LinearModel, omega: float, inputs: Sequence[int], outputs: Sequence[int]) -> Complex:
    """(K,I) response of the outputs with numbers `outputs` to unit harmonic loads at omega (rad/s) of the inputs with
    numbers `inputs`; ValueError at an undamped resonance."""
    C, D = model.C[list(outputs)], model.D[np.ix_(outputs, inputs)].astype(complex)
    known = ~np.isnan(C).any(axis=1)
    try:
        D += C @ np.linalg.solve(1j * omega * np.eye(len(model.A)) - model.A, model.B[:, list(inputs)])
    except np.linalg.LinAlgError:
        D[:] = np.inf
    if not np.isfinite(D[known]).all():
        raise ValueError(f"omega = {omega:g} rad/s is an undamped resonance: nothing is finite")
    return D


def place(names: tuple[tuple[str, str], ...], name: str, kind: str) -> int:
    """The number of an input or output; KeyError if there is none of this name."""
    known = [found for found, _ in names]
    if name not in known:
        raise KeyError(f"no {kind} {name!r}; there are {', '.join(known)}")
    return known.index(name)
