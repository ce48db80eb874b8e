"""First-order uncertainty of the outputs of a run, from that of numbers of its scene.

With S = d outputs/dp and the covariance C of the parameters, the variance of an output is s' C s. Parameter k
contributes s_k (C s)_k to it; contributions add up to the variance, and are all positive where parameters are
independent (Joint Committee for Guides in Metrology, JCGM 100:2008, 5.1 and 5.2).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Unpack

import numpy as np

from flexmb.integrate.integrator import Method
from flexmb.run.simulate import RunSettings
from flexmb.scene.schema import Scene
from flexmb.sensitivity.fit import Fit, aligned
from flexmb.sensitivity.sensitivities import Sensitivities, sensitivities
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.typing import Real

SYMMETRIC = 1e-9  # relative difference of opposite entries of a correlation, and a negative eigenvalue, from rounding


@dataclass(frozen=True)
class Uncertainties:
    """Standard deviations of the outputs of a run, by `uncertainty`.

    t (T,) s; outputs (K,) with their values (T,K) and standard deviations sigma (T,K); parameters (P,) with their
    covariance (P,P); contributions (T,K,P): parts of the variance sigma^2 that each parameter brings, which add up to
    it; sensitivities: the derivatives from which this follows.
    """

    t: Real
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    values: Real
    sigma: Real
    parameters: tuple[str, ...]
    covariance: Real
    contributions: Real
    sensitivities: Sensitivities

    __repr__ = brief

    @property
    def shares(self) -> Real:
        """(T,K,P) contributions relative to the variance; 0 where that is zero, NaN where it is not determined."""
        variance = self.sigma[..., None] ** 2
        return np.divide(self.contributions, variance, out=np.zeros_like(self.contributions), where=variance != 0.0)

    def __str__(self) -> str:
        """For each output its largest standard deviation, and the shares of the parameters in it."""
        lines = []
        for k, output in enumerate(self.outputs):
            if np.all(np.isnan(self.sigma[:, k])):
                lines.append(f"{output}: not determined by the motion, because closures are redundant")
                continue
            i = int(np.nanargmax(self.sigma[:, k]))
            lines.append(f"{output}: sigma at most {self.sigma[i, k]:.3g} {self.units[k]}, at t = {self.t[i]:g} s")
            order = np.argsort(-self.contributions[i, k])
            shares = self.shares[i, k]
            lines += [
                f"  {line}" for line in aligned([(self.parameters[p], f"{100.0 * shares[p]:.1f} %") for p in order])
            ]
        return "\n".join(lines)


def uncertainty(
    scene: Scene,
    t_end: float,
    given: Mapping[str, float] | Fit,
    of: Sequence[str],
    method: Method = "dop853",
    *,
    correlation: Any = None,
    samples: int | Sequence[float] | Real = 201,
    **settings: Unpack[RunSettings],
) -> Uncertainties:
    """Standard deviations of outputs over time, to first order, and what each parameter contributes to them.

    given: standard deviations by parameter, in the units of the scene, or a `Fit` with its covariance. correlation
    (P,P): of the parameters in the order in which they are given; independent if left out. All other arguments are
    those of `sensitivities`. First order means that the outputs are linear in the parameters within a few standard
    deviations; for large ones compare with a sweep. Raises ValueError for sigmas or correlations that make no sense, or
    a fit with parameters that it could not identify, and what `sensitivities` raises.
    """
    names, covariance = _covariance(given, correlation)
    spread = sensitivities(scene, t_end, names, of, method, samples=samples, **settings)
    S = spread.derivatives
    contributions = S * (S @ covariance)
    sigma = np.sqrt(np.maximum(np.sum(contributions, axis=-1), 0.0))
    return Uncertainties(
        spread.t,
        spread.outputs,
        spread.units,
        spread.values,
        sigma,
        spread.parameters,
        covariance,
        contributions,
        spread,
    )


def _covariance(given: Mapping[str, float] | Fit, correlation: Any) -> tuple[tuple[str, ...], Real]:
    """Names (P,) and covariance (P,P)."""
    if isinstance(given, Fit):
        if correlation is not None:
            raise ValueError("a fit has a covariance of its own: leave out correlation")
        if given.unidentifiable:
            raise ValueError(f"the fit did not identify {', '.join(given.unidentifiable)}: fit fewer parameters")
        return given.parameters, given.covariance
    if not isinstance(given, Mapping):
        raise TypeError(f"given is {type(given).__name__}: give standard deviations by name, or what `fit` found")
    sigma = np.array([arguments.number(f'given["{name}"]', sigma_of) for name, sigma_of in given.items()])
    if not len(sigma):
        raise ValueError("no parameters are given: give standard deviations by name")
    if not np.all(sigma >= 0.0):
        raise ValueError(f"given: {list(given)[int(np.argmin(sigma))]} has a negative standard deviation")
    R = (
        np.eye(len(sigma))
        if correlation is None
        else arguments.finite("correlation", arguments.array("correlation", correlation))
    )
    if R.shape != (len(sigma), len(sigma)):
        raise ValueError(f"correlation has the shape {R.shape}, but there are {len(sigma)} parameters")
    if not np.allclose(R, R.T, rtol=0.0, atol=SYMMETRIC) or not np.allclose(np.diag(R), 1.0, rtol=0.0, atol=SYMMETRIC):
        raise ValueError("correlation must be symmetric, with ones on the diagonal")
    if np.min(np.linalg.eigvalsh(R)) < -SYMMETRIC:
        raise ValueError("correlation has a negative eigenvalue: no quantities correlate like this")
    return tuple(given), R * np.outer(sigma, sigma)
