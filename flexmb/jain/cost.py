"""Operation counts of the two forward dynamics of Jain & Rodriguez, by the polynomials of their section VII.

The counts are those of one evaluation, divisions counted as multiplications, as polynomials in the number of modes n of
a body. Functions of several bodies take the numbers of modes in the paper's order, tip to base. The paper assumes
serial chains, one rotation per hinge, free-free modes, and level ruthless (appendix B) with constants computed
beforehand. Every polynomial is that of an inner flexible body. The paper gives none for tips, bases and rigid bodies;
these cost less than the polynomials say with n = 0.

Correction of the print: an operation count must be a whole number for every n. All polynomials fulfil this except the
additions of R(k), printed as n^2 + 97/2 n + 116. They are read as n^2/2 + 97/2 n + 116: n (n + 1)/2 sums for the
constant modal block, and 48 n, as many as the multiplications. The paper's lists omit the products of the modal block
of R(k), which are needed unless it is referred to the hinge beforehand, and, in the articulated-body algorithm, the
velocities and the bias (step 1 of section VI.B), which the composite-body algorithm counts in its bias vector.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from flexmb.jit.counting import Operations

EXPLICIT_UP_TO = 7  # modes: with more, the identity of appendix B inverts D_f in fewer operations


def composite(modes: Sequence[int]) -> Operations:
    """Composite-body forward dynamics, section VII.A: mass matrix, bias and the solution of their linear equations."""
    bodies = Operations()
    for k, n in enumerate(modes, start=1):
        bodies += composite_inertia(n) + mass_matrix_row(k, n) + bias(n)
    unknowns = sum(modes) + len(modes)
    return bodies + Operations(additions=unknowns) + linear_equations(unknowns)


def articulated(modes: Sequence[int]) -> Operations:
    """Articulated-body forward dynamics, section VII.B, with the cheaper inversion of D_f for every body."""
    bodies = Operations()
    for n in modes:
        inertia = articulated_inertia(n) if n <= EXPLICIT_UP_TO else articulated_inertia_by_identity(n)
        bodies += inertia + inward_sweep(n) + outward_sweep(n)
    return bodies


def composite_inertia(n: int) -> Operations:
    """VII.A.1: composite inertia R(k)."""
    return _operations(n, multiplications="90 48", additions="116 97/2 1/2")


def mass_matrix_row(k: int, n: int) -> Operations:
    """VII.A.2: row k of the mass matrix, k blocks of bodies with as many modes, without R(k).

    The algorithm makes N - k + 1 blocks, column by column; over a chain of equal bodies the sums are the same.
    """
    return k * _operations(n, multiplications="13 34 12", additions="13 24 11")


def bias(n: int) -> Operations:
    """VII.A.3: the bias vector by inverse dynamics."""
    return _operations(n, multiplications="206 54 2", additions="143 50 2")


def linear_equations(unknowns: int) -> Operations:
    """VII.A.5: L D L' of a symmetric matrix and both substitutions."""
    return _operations(unknowns, multiplications="0 -2/3 3/2 1/6", additions="0 -7/6 1 1/6")


def articulated_inertia(n: int) -> Operations:
    """VII.B.1a: articulated inertias with D_f inverted explicitly."""
    return _operations(n, multiplications="180 764/3 25/2 5/6", additions="164 548/3 21/2 5/6")


def articulated_inertia_by_identity(n: int) -> Operations:
    """VII.B.1b: articulated inertias with D_f inverted by the matrix identity of appendix B."""
    return _operations(n, multiplications="572 255 12", additions="445 182 13")


def inward_sweep(n: int) -> Operations:
    """VII.B.2: recursion of the bias forces, tip to base."""
    return _operations(n, multiplications="49 25 1", additions="50 24 1")


def outward_sweep(n: int) -> Operations:
    """VII.B.3: recursion of the accelerations, base to tip."""
    return _operations(n, multiplications="52 18", additions="42 19")


def _operations(n: int, multiplications: str, additions: str) -> Operations:
    """Values at n of polynomials given by their coefficients, lowest power first."""
    return Operations(_whole(n, multiplications), _whole(n, additions))


def _whole(n: int, coefficients: str) -> int:
    """The value of a polynomial at n; ValueError if it is not a whole number."""
    value = sum(Fraction(c) * n**power for power, c in enumerate(coefficients.split()))
    if value != int(value):
        raise ValueError(f"{value} is no number of operations: coefficients {coefficients} at {n}")
    return int(value)
