"""The first flapping mode of a cantilever that spins about z, by polynomials: a solution of its own, to 12 digits.

EI w'''' - (T w')' + m w_tt = 0 with the tension T = m Omega^2 (L^2 - x^2)/2 of a hub of zero radius. The shape is a sum
of x^2 times Legendre polynomials, whose coefficients solve (K + G) c = omega^2 M c; 20 of them leave 1e-12. The beam
turns with x = r(t) and keeps its length: r is x less half the integral of the square of the slope.
"""

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import Legendre, leggauss
from scipy.linalg import eigh

LENGTH, STIFFNESS, MASS = 2.0, 40.0, 0.5  # m, N m^2, kg/m
UNIT = np.sqrt(STIFFNESS / (MASS * LENGTH**4))  # rad/s
SPIN = 6.0 * UNIT
TIP = 2e-3  # m
TERMS = 20


def exact(times):
    """Position (T, 3) of tip and middle (m)."""
    frequency, shape = first_mode()
    slope = shape.deriv()
    phase, turn = np.cos(frequency * times), SPIN * np.asarray(times)
    channels = {}
    for name, place in {"tip": 1.0, "middle": 0.5}.items():
        shortening = 0.5 * _integral(slope, place) / LENGTH * phase**2
        radius = place * LENGTH - shortening
        channels[f"marker:{name}.position"] = np.column_stack(
            [radius * np.cos(turn), radius * np.sin(turn), shape(place) * phase]
        )
    return channels


def first_mode():
    """Frequency (rad/s) and deflection (m) over x/L of the lowest flapping mode."""
    nodes, weights = leggauss(64)
    x, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    lift = Polynomial([0.0, 0.0, 1.0]).convert(kind=Legendre, domain=[0, 1])
    terms = [lift * Legendre.basis(k, domain=[0, 1]) for k in range(TERMS)]
    shape, slope, bend = (np.array([term.deriv(n)(x) if n else term(x) for term in terms]) for n in (0, 1, 2))
    tension = 0.5 * (SPIN / UNIT) ** 2 * (1.0 - x**2)
    stiffness = (bend * weights) @ bend.T + (slope * weights * tension) @ slope.T
    squares, vectors = eigh(stiffness, (shape * weights) @ shape.T)
    mode = sum((c * term for c, term in zip(vectors[:, 0], terms, strict=True)), Legendre([0.0], domain=[0, 1]))
    return np.sqrt(squares[0]) * UNIT, mode * (TIP / mode(1.0))


def _integral(slope, end):
    square = (slope * slope).integ()
    return square(end) - square(0.0)
