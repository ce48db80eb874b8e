"""How well M is known: what rounding does to its factors M = F F', as a motion meets it.

An articulated inertia is known to the rounding of what it was summed from before eliminations took from it: to about
u times J = tr A of its angular block and m = tr C of its linear one, however little is left. In a motion x (nu,) of the
speeds rounding therefore stands for the energy u |S x|^2,

    |S x|^2 = sum over hinges  J |alpha^+|^2 + m |a^+|^2 + sum over their speeds (J |h_w|^2 + m |h_v|^2) x_j^2
            + sum over modes   (D_nn + J |W_n|^2 + m |L_n|^2) x_n^2,

with J and m of P about O before modes and hinge are eliminated, [alpha^+; a^+] the motion of O as a point of the
parent, [h_w; h_v] a column of H, and [W_n; L_n] the motion of a node with O on it. M gives it x'M x = |F'x|^2. The
largest ratio of the two, kappa = |S F'^-1|^2, is the condition of M in units that do not matter; u kappa is the share
of rounding in the accelerations, measured by S. A motion for which it is 1 has no inertia but rounding.
"""

from flexmb.jain.explicit import force_to_parent
from flexmb.jain.innovations import clear_body, innovations, respond
from flexmb.jain.kinematics import carried_acceleration, motion_column
from flexmb.kernel import helper
from flexmb.spatial.vector import dot, scale, vec3


@helper
def weigh(c, w, x):
    """y = F^-1 S'S F'^-1 y of the free speeds, y in x.speed.innovation: kappa is the largest eigenvalue of this."""
    respond(c, w, x)
    for k in range(c.body.shape[0]):
        clear_body(c, x, k)
    for k in range(c.body.shape[0]):
        P = w.body[k].inertia
        J, m = P[0] + P[1] + P[2], P[15] + P[16] + P[17]
        _weigh_modes(c, w, x, k, J, m)
        for n in range(c.body[k].nv):
            j = c.body[k].u_index + n
            angular, linear = motion_column(c, w, k, n)
            x.speed[j].applied = (J * dot(angular, angular) + m * dot(linear, linear)) * x.speed[j].acceleration
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            j = c.wheel[i].u_index
            x.speed[j].applied = c.wheel[i].axial * x.speed[j].acceleration
        if c.body[k].parent >= 0:
            alpha, a = carried_acceleration(c, w, x, k)
            force_to_parent(c, w, x, k, scale(-J, alpha), scale(-m, a))
    innovations(c, w, x)


@helper
def _weigh_modes(c, w, x, k, J, m):
    """S'S x of the modes of body k: D_nn is the sum of squares of a row of its factor."""
    out = c.body[k].outboard_port
    for n in range(c.body[k].modes):
        size = 0.0
        for i in range(n + 1):
            size += w.pff[k, n, i] * w.pff[k, n, i]
        if out >= 0:
            W, L = vec3(w.port_mode[out, n].W, 0), vec3(w.port_mode[out, n].L, 0)
            size += J * dot(W, W) + m * dot(L, L)
        j = c.body[k].etad_index + n
        x.speed[j].applied = size * x.speed[j].acceleration
