"""The rotation vector of Magnus' expansion to the sixth order, its derivatives along changes of the curvature.

R' = R k~ along an interval of length h with the coordinate xi in [-1, 1]; P_n are Legendre's polynomials. From

    whole = int k ds            linear = 6 int P_1(xi) k ds            square = 30 int P_2(xi) k ds

R advances by exp(Omega~), with an error of h^7 (Blanes, Casas, Ros, BIT 40, 2000, 434, with the signs of R' = R k~):

    a = whole - square/12       C = a x linear          D = a x (C - 2 square)
    E = 20 a + square + C       F = linear - D/60       Omega = whole + E x F / 240

All are analytic functions. `linear` begins with h^2, `square` with h^3.
"""

from flexmb.jit.kernel import helper
from flexmb.spatial.vector import add, axpy, cross, scale, sub


@helper
def magnus(whole, linear, square):
    """Omega, and what its derivatives need: (a, linear, C - 2 square, E, F)."""
    a = axpy(-1.0 / 12.0, square, whole)
    C = cross(a, linear)
    inner = axpy(-2.0, square, C)
    E = add(axpy(20.0, a, square), C)
    F = axpy(-1.0 / 60.0, cross(a, inner), linear)
    return axpy(1.0 / 240.0, cross(E, F), whole), (a, linear, inner, E, F)


@helper
def magnus_change(at, whole, linear, square):
    """The change of Omega with the changes `whole`, `linear` and `square`, in which it is linear; `at`: of `magnus`."""
    _, e, f = _changes(at, whole, linear, square)
    return axpy(1.0 / 240.0, add(cross(e, at[4]), cross(at[3], f)), whole)


@helper
def magnus_transposed(at, x):
    """(whole, linear, square) whose products with the arguments of `magnus_change` sum up to x times its result."""
    a, linear, inner, E, F = at
    on_E, on_F = scale(1.0 / 240.0, cross(F, x)), scale(1.0 / 240.0, cross(x, E))
    turned = scale(1.0 / 60.0, on_F)
    on_inner = cross(a, turned)
    on_C = add(on_E, on_inner)
    on_a = add(axpy(20.0, on_E, cross(turned, inner)), cross(linear, on_C))
    on_square = axpy(-1.0 / 12.0, on_a, axpy(-2.0, on_inner, on_E))
    return add(x, on_a), add(on_F, cross(on_C, a)), on_square


@helper
def magnus_bend(at, whole, linear, square):
    """The second derivative of Omega where its arguments change at these constant rates."""
    (a, inner), e, f = _changes(at, whole, linear, square)
    C = scale(2.0, cross(a, linear))
    F = scale(-1.0 / 60.0, axpy(2.0, cross(a, inner), cross(at[0], C)))
    return scale(1.0 / 240.0, add(axpy(2.0, cross(e, f), cross(C, at[4])), cross(at[3], F)))


@helper
def _changes(at, whole, linear, square):
    """Those of (a, C - 2 square), of E and of F."""
    a = axpy(-1.0 / 12.0, square, whole)
    C = sub(cross(at[0], linear), cross(at[1], a))
    inner = axpy(-2.0, square, C)
    E = add(axpy(20.0, a, square), C)
    return (a, inner), E, axpy(-1.0 / 60.0, sub(cross(at[0], inner), cross(at[2], a)), linear)
