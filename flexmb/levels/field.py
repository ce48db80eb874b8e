"""Kinematics of one point of the modal field: position x + phi eta + R p, rotation R = exp(skew(psi eta)).

The angular velocity relative to the body is the exact one of R: W etadot with W_n = J_l(theta) psi_n. Inertia points
and ports use the same functions. All components are in body axes. At level stiffened displacement and rotation vector
have a part of second order, 1/2 eta' G eta: their rates are those of the linear field with phi_n + (G eta)_n for phi_n,
and etadot' G etadot is their acceleration at etaddot = 0.
"""

from flexmb.jit.kernel import helper
from flexmb.jit.strips import strip, width
from flexmb.spatial.rotation import (
    exponential,
    exponential_coefficients,
    left_jacobian,
    left_jacobian_rate,
    left_jacobian_times,
)
from flexmb.spatial.rows import column6, put6, store_column6, strips6, total6
from flexmb.spatial.spatial_vector import ZERO6, axpy6, sum6
from flexmb.spatial.vector import add, cross, dot, times, vec3


@helper
def field_motion(w, x, p, shapes, eta, etad, nm, columns):
    """Motion of a point carried by the modal field.

    w is the workspace that contains the rows; x (3) rest position; p (3) fixed offset in point axes; shapes (6,m) mode
    shapes [rotation; translation]; eta, etad (m,). Writes columns (6,m) [W; L]: angular and linear velocity at unit
    modal speeds. Returns position (3), R (9), and relative to the body the velocities w, v and the accelerations
    alpha, a at etaddot = 0 (3 each).
    """
    displacement, rate = ZERO6, ZERO6  # [rotation vector; translation]
    for n in range(0, nm, width(w)):
        shape = strips6(w, shapes, n)
        displacement = axpy6(strip(w, eta, n), shape, displacement)
        rate = axpy6(strip(w, etad, n), shape, rate)
    (theta, u), (theta_rate, v) = total6(w, displacement), total6(w, rate)
    k = exponential_coefficients(dot(theta, theta))
    R = exponential(theta, k)
    arm = times(R, p)
    omega = left_jacobian_times(theta, k, theta_rate)
    alpha = left_jacobian_rate(theta, k, theta_rate)
    J = left_jacobian(theta, k)
    for n in range(0, nm, width(w)):
        psi, phi = strips6(w, shapes, n)
        W = times(J, psi)
        put6(w, columns, n, (W, add(phi, cross(W, arm))))
    a = add(cross(alpha, arm), cross(omega, cross(omega, arm)))
    return add(add(x, u), arm), R, omega, add(v, cross(omega, arm)), alpha, a


@helper
def second_order_motion(x, p, shapes, second, eta, etad, nm, columns):
    """`field_motion` for a point of level stiffened; `second` (m,m) records of its second-order field."""
    displacement = rate = bent = ZERO6  # [rotation vector; translation]
    for n in range(nm):
        at_rest = column6(shapes, n)
        now, change = _shape_now(at_rest, second[n], eta, etad, nm)
        displacement = axpy6(0.5 * eta[n], sum6(at_rest, now), displacement)
        rate = axpy6(etad[n], now, rate)
        bent = axpy6(etad[n], change, bent)
        store_column6(columns, n, now)
    (theta, u), (theta_rate, v), (twist, bend) = displacement, rate, bent
    k = exponential_coefficients(dot(theta, theta))
    R = exponential(theta, k)
    arm = times(R, p)
    w = left_jacobian_times(theta, k, theta_rate)
    alpha = add(left_jacobian_rate(theta, k, theta_rate), left_jacobian_times(theta, k, twist))
    for n in range(nm):
        psi, phi = column6(columns, n)
        wn = left_jacobian_times(theta, k, psi)
        store_column6(columns, n, (wn, add(phi, cross(wn, arm))))
    a = add(bend, add(cross(alpha, arm), cross(w, cross(w, arm))))
    return add(add(x, u), arm), R, w, add(v, cross(w, arm)), alpha, a


@helper
def _shape_now(shape, second, eta, etad, nm):
    """phi_n + (G eta)_n of mode n, for rotation vector and displacement, and their rates (G etadot)_n."""
    rate = ZERO6
    for i in range(nm):
        G = vec3(second[i].rotation, 0), vec3(second[i].translation, 0)
        shape = axpy6(eta[i], G, shape)
        rate = axpy6(etad[i], G, rate)
    return shape, rate
