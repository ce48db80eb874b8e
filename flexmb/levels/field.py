"""Kinematics of one point of the modal field: position x + phi eta + R p, rotation R = exp(skew(psi eta)).

The angular velocity relative to the body is the true rate of R: W etadot with W_n = J_l(theta) psi_n. Used for inertia
points and for ports alike. All components are in body axes. At level stiffened displacement and rotation vector have a
part of second order, 1/2 eta' G eta: their rates are those of the linear field with phi_n + (G eta)_n for phi_n, and
they accelerate by etadot' G etadot at etaddot = 0.
"""

from flexmb.jit.kernel import helper
from flexmb.spatial.rotation import (
    exponential,
    exponential_coefficients,
    left_jacobian_rate,
    left_jacobian_times,
)
from flexmb.spatial.vector import add, add3, axpy, cross, dot, store3, times, vec3


@helper
def field_motion(x, p, shapes, modes, nm, columns):
    """Motion of a point carried by the modal field.

    x (3) rest position, p (3) fixed offset in point axes; shapes (m,) records of mode shapes (translation, rotation);
    modes (m,) records of eta, etad. Writes columns (m,) records W, L: angular and linear velocity per modal speed.
    Returns position (3), R (9), relative velocity w, v and the relative acceleration alpha, a at etaddot = 0 (3 each).
    """
    u = (0.0, 0.0, 0.0)
    v = (0.0, 0.0, 0.0)
    theta = (0.0, 0.0, 0.0)
    theta_rate = (0.0, 0.0, 0.0)
    for n in range(nm):
        phi = vec3(shapes[n].translation, 0)
        psi = vec3(shapes[n].rotation, 0)
        u = axpy(modes[n].eta, phi, u)
        v = axpy(modes[n].etad, phi, v)
        theta = axpy(modes[n].eta, psi, theta)
        theta_rate = axpy(modes[n].etad, psi, theta_rate)
    k = exponential_coefficients(dot(theta, theta))
    R = exponential(theta, k)
    arm = times(R, p)
    w = left_jacobian_times(theta, k, theta_rate)
    alpha = left_jacobian_rate(theta, k, theta_rate)
    for n in range(nm):
        wn = left_jacobian_times(theta, k, vec3(shapes[n].rotation, 0))
        store3(columns[n].W, 0, wn)
        store3(columns[n].L, 0, add(vec3(shapes[n].translation, 0), cross(wn, arm)))
    a = add(cross(alpha, arm), cross(w, cross(w, arm)))
    return add(add(x, u), arm), R, w, add(v, cross(w, arm)), alpha, a


@helper
def second_order_motion(x, p, shapes, second, modes, nm, columns):
    """The same for a point of level stiffened: `second` (m,m) records of its second-order field."""
    u = v = bend = (0.0, 0.0, 0.0)
    theta = theta_rate = twist = (0.0, 0.0, 0.0)
    for n in range(nm):
        phi, psi, phi_rate, psi_rate = _shape_now(shapes[n], second[n], modes, nm)
        eta, etad = modes[n].eta, modes[n].etad
        u = axpy(0.5 * eta, add(vec3(shapes[n].translation, 0), phi), u)
        theta = axpy(0.5 * eta, add(vec3(shapes[n].rotation, 0), psi), theta)
        v = axpy(etad, phi, v)
        theta_rate = axpy(etad, psi, theta_rate)
        bend = axpy(etad, phi_rate, bend)
        twist = axpy(etad, psi_rate, twist)
        store3(columns[n].W, 0, psi)
        store3(columns[n].L, 0, phi)
    k = exponential_coefficients(dot(theta, theta))
    R = exponential(theta, k)
    arm = times(R, p)
    w = left_jacobian_times(theta, k, theta_rate)
    alpha = add(left_jacobian_rate(theta, k, theta_rate), left_jacobian_times(theta, k, twist))
    for n in range(nm):
        wn = left_jacobian_times(theta, k, vec3(columns[n].W, 0))
        store3(columns[n].W, 0, wn)
        add3(columns[n].L, 0, cross(wn, arm))
    a = add(bend, add(cross(alpha, arm), cross(w, cross(w, arm))))
    return add(add(x, u), arm), R, w, add(v, cross(w, arm)), alpha, a


@helper
def _shape_now(shape, second, modes, nm):
    """Velocity and rate of the rotation vector per speed of mode n, phi_n + (G eta)_n, and their rates (G etadot)_n."""
    phi = vec3(shape.translation, 0)
    psi = vec3(shape.rotation, 0)
    phi_rate = psi_rate = (0.0, 0.0, 0.0)
    for i in range(nm):
        G = vec3(second[i].translation, 0)
        H = vec3(second[i].rotation, 0)
        phi = axpy(modes[i].eta, G, phi)
        psi = axpy(modes[i].eta, H, psi)
        phi_rate = axpy(modes[i].etad, G, phi_rate)
        psi_rate = axpy(modes[i].etad, H, psi_rate)
    return phi, psi, phi_rate, psi_rate
