"""Kinematics of one point of the modal field: position x + phi eta + R p, rotation R = exp(skew(psi eta)).

The angular velocity relative to the body is the true rate of R: W etadot with W_n = J_l(theta) psi_n. Used for inertia
points and for ports alike. All components are in body axes.
"""

from flexmb.kernel import helper
from flexmb.spatial.rotation import (
    exponential,
    exponential_coefficients,
    left_jacobian_rate,
    left_jacobian_times,
)
from flexmb.spatial.vector import add, axpy, cross, dot, store3, times, vec3


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
