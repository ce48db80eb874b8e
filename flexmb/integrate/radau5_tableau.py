"""Coefficients of Radau IIA of order 5: Hairer, Wanner, Solving Ordinary Differential Equations II (1996), IV.5, IV.8.

Only the Runge-Kutta matrix and the error weights are data; what else the method needs follows from them.
"""

from __future__ import annotations

import numpy as np

_R6 = np.sqrt(6.0)

C = np.array([(4.0 - _R6) / 10.0, (4.0 + _R6) / 10.0, 1.0])
A = np.array([
    [(88.0 - 7.0 * _R6) / 360.0, (296.0 - 169.0 * _R6) / 1800.0, (-2.0 + 3.0 * _R6) / 225.0],
    [(296.0 + 169.0 * _R6) / 1800.0, (88.0 + 7.0 * _R6) / 360.0, (-2.0 - 3.0 * _R6) / 225.0],
    [(16.0 - _R6) / 36.0, (16.0 + _R6) / 36.0, 1.0 / 9.0],
])  # fmt: skip

# (8.19): with the slope f0 at the start, h f0 + E'Z is h times the defect of the collocation polynomial there.
E = np.array([-13.0 - 7.0 * _R6, -13.0 + 7.0 * _R6, -1.0]) / 3.0

# A^-1 = V diag(REAL, COMPLEX, conj COMPLEX) W: stages Z = V w decouple into one real and one complex system.
_values, _vectors = np.linalg.eig(np.linalg.inv(A))
_order = np.lexsort((-_values.imag, np.abs(_values.imag)))  # the real one, then the pair with the positive part first
_values, _vectors = _values[_order], _vectors[:, _order]
_inverse = np.linalg.inv(_vectors)
REAL, COMPLEX = float(_values[0].real), complex(_values[1])
V_REAL, V_COMPLEX = np.ascontiguousarray(_vectors[:, 0].real), np.ascontiguousarray(_vectors[:, 1])
W_REAL, W_COMPLEX = np.ascontiguousarray(_inverse[0].real), np.ascontiguousarray(_inverse[1])

# Collocation polynomial y + sum over i, k of P[i, k] Z[i] x^(k+1), through y at x = 0 and y + Z_i at x = C_i.
P = np.ascontiguousarray(np.linalg.inv(C[:, None] ** np.arange(1, 4)).T)
