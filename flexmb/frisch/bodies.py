"""One body's share of the nested-body equations: (47)-(53), the momentum rates (86)-(88), the modal rows (110).

Corrections of the print (docs/errata.md): the parameters themselves; A_n and Q_n, in (110) and in the matrix, depend on
the deformation to first order; Phi and Delta-L keep those second-order terms that cancel terms of G (98), so that the
terms of one body about its hinge point are of first order; loads at nodes and gravity act on the modes; the frame of a
wheel turns with its node.
"""

from flexmb.frisch.tables import FIXED_SPIN_AXIS, NO_LOADS_ON_MODES, SECOND_ORDER
from flexmb.jit.kernel import helper
from flexmb.spatial.rows import column3, column6
from flexmb.spatial.spatial_vector import dot6, shift_force
from flexmb.spatial.vector import (
    add,
    add3,
    axpy,
    cross,
    dot,
    mat3,
    rotate_sym,
    scale,
    store3,
    sub,
    sym6,
    sym_add,
    sym_axpy,
    sym_times,
    times,
    times_t,
    vec3,
)
from flexmb.tables.arrays import FORCE, NODE_AXES


@helper
def body_terms(c, w, k):
    """Mass, first moment, Phi + G about the hinge point, and right-hand sides of (107), (108), (110) of body k."""
    nest, e = w.nest[k], c.element[k]
    nm = c.body[k].modes
    R = mat3(nest.rotation, 0)
    omega, mass = times_t(R, vec3(nest.omega, 0)), e.mass
    moved, moved_rate, momentum = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    Phi, Phi_rate = sym6(e.Phi, 0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for n in range(nm):
        eta, etad = w.modal[k, n], w.modal_rate[k, n]
        A, E = vec3(c.element_mode[k, n].A, 0), sym6(c.element_mode[k, n].E, 0)
        moved = axpy(eta, A, moved)  # (47)
        moved_rate = axpy(etad, A, moved_rate)  # (171)
        Phi = sym_axpy(eta, E, Phi)  # (49)
        Phi_rate = sym_axpy(etad, E, Phi_rate)  # (172)
        momentum = axpy(etad, vec3(c.element_mode[k, n].Q, 0), momentum)  # (53)
    alpha = add(vec3(e.alpha, 0), moved)
    if nm > 0 and c.printed[SECOND_ORDER] == 0:  # cancels m (dalpha.dalpha 1 - dalpha dalpha) in G below
        Phi = sym_axpy(-mass, steiner(moved, moved), Phi)
        Phi_rate = sym_axpy(-2.0 * mass, steiner(moved, moved_rate), Phi_rate)
        momentum = axpy(-mass, cross(moved, moved_rate), momentum)
    for n in range(nm):
        _modal_row(c, w, k, n, R, omega, moved)
    alpha_world = times(R, alpha)
    store3(nest.alpha, 0, alpha_world)
    nest.mass = mass
    store3(nest.first, 0, scale(mass, alpha_world))
    store_sym6(nest.inertia, 0, rotate_sym(R, sym_axpy(mass, steiner(alpha, alpha), Phi)))  # Phi + G (98)
    turning = add(sym_times(Phi_rate, omega), cross(omega, add(sym_times(Phi, omega), momentum)))  # (87), (101)
    coriolis = cross(omega, add(cross(omega, alpha), scale(2.0, moved_rate)))
    force = scale(-mass, add(times(R, coriolis), vec3(nest.path, 0)))  # - C (100)
    force = axpy(mass, vec3(c.gravity, 0), force)
    store3(nest.force, 0, force)
    store3(nest.torque, 0, sub(cross(alpha_world, force), times(R, turning)))


@helper
def _modal_row(c, w, k, n, R, omega, moved):
    """A_n and Q_n in World axes and the right-hand side of (110), (186) for mode n of body k.

    The elastic force has the true deformation, also at level ruthless, where w.modal is zero.
    """
    e = c.element[k]
    A0, Q = vec3(c.element_mode[k, n].A, 0), vec3(c.element_mode[k, n].Q, 0)
    change, K = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    H = sym6(c.element_mode[k, n].H, 0)  # with sum_m F_mn a_m added
    elastic = 0.0
    for m in range(c.body[k].modes):
        eta, etad = w.modal[k, m], w.modal_rate[k, m]
        pair = c.element_pair[k, m, n]
        change = axpy(eta, vec3(pair.A1, 0), change)
        Q = axpy(eta, vec3(pair.Q1, 0), Q)
        H = sym_axpy(eta, sym6(pair.F, 0), H)
        K = axpy(etad, vec3(pair.K, 0), K)
        true_eta, true_etad = w.q[c.body[k].eta_index + m], w.u[c.body[k].etad_index + m]
        elastic += c.stiffness[k, n, m] * true_eta + c.damping[k, n, m] * true_etad
    A = add(A0, change)
    Q = axpy(-e.mass, cross(moved, change), Q)
    store3(w.mode[k, n].A, 0, times(R, A))
    store3(w.mode[k, n].Q, 0, times(R, Q))
    path = e.mass * dot(vec3(w.mode[k, n].A, 0), vec3(w.nest[k].path, 0))
    path += e.mass * dot(A0, cross(omega, cross(omega, vec3(e.alpha, 0))))
    row = dot(omega, sym_times(H, omega)) - 2.0 * dot(omega, K) - path - elastic
    if c.printed[NO_LOADS_ON_MODES] == 0:
        row += e.mass * dot(vec3(w.mode[k, n].A, 0), vec3(c.gravity, 0))
    w.mode[k, n].row = row


@helper
def wheel_terms(c, w, k, i):
    """Wheel i of body k: I_W, bias of its relative rate (122), (131), (134), rate (94), (105) of its momentum (102).

    Adds I_W to the inertia and minus the rate to the torque of the body, and writes its columns of S.
    """
    wheel, port, omega = w.wheel[i], w.port[c.wheel[i].port], vec3(w.nest[k].omega, 0)
    axis, spin = times(mat3(port.R, 0), vec3(c.wheel[i].axis, 0)), w.u[c.wheel[i].u_index]
    axial, transverse = c.wheel[i].axial, c.wheel[i].transverse
    d = axial - transverse
    x, y, z = axis
    inertia = (
        transverse + d * x * x, transverse + d * y * y, transverse + d * z * z, d * x * y, d * x * z, d * y * z,
    )  # fmt: skip
    node, node_rate = vec3(port.v, 0), vec3(port.a, 0)  # the angular parts
    total = add(omega, axpy(spin, axis, node))  # (120), inertial
    bias, rate = node_rate, cross(omega, sym_times(inertia, total))
    if c.printed[FIXED_SPIN_AXIS] == 0:
        # The print turns I_W with the body. It turns with the node, at omega + node: the terms with `node` are added.
        bias = axpy(spin, cross(node, axis), bias)
        rate = add(rate, sub(cross(node, sym_times(inertia, total)), sym_times(inertia, cross(node, total))))
    store3(wheel.axis, 0, axis)
    store_sym6(wheel.inertia, 0, inertia)
    store3(wheel.spin_bias, 0, bias)
    store3(wheel.rate, 0, rate)
    at = c.column[c.wheel[i].u_index].start
    store3(w.S, at, axis)  # partition h of (133)
    if c.wheel_entry[i] >= 0:
        for n in range(c.body[k].modes):  # partition phiR_W (121) of (126)
            start = c.column[c.body[k].etad_index + n].start + c.wheel_entry[i]
            store3(w.S, start, column3(w.port_mode[c.wheel[i].port], 0, n))
    store_sym6(w.nest[k].inertia, 0, sym_add(sym6(w.nest[k].inertia, 0), inertia))
    add3(w.nest[k].torque, 0, scale(-1.0, rate))


@helper
def load_terms(c, w, k, i):
    """Load i at its node: on the body (80), (81), and on its modes, on which (111) as printed has no loads."""
    port, F = node_load(c, w, i)
    torque, force = shift_force(F, vec3(w.port[port].r, 0))
    add3(w.nest[k].force, 0, force)
    add3(w.nest[k].torque, 0, torque)
    if c.printed[NO_LOADS_ON_MODES] == 0:
        for n in range(c.body[k].modes):
            phi = column6(w.port_mode[port], n)  # phiR, phiT
            w.mode[k, n].row += dot6(phi, F)


@helper
def node_load(c, w, i):
    """Load i: its port, and [torque; force] about the port in World axes."""
    port, zero = c.load[i].port, (0.0, 0.0, 0.0)
    value = scale(w.function[c.load[i].function, 0], vec3(c.load[i].direction, 0))
    if c.load[i].frame == NODE_AXES:
        value = times(mat3(w.port[port].R, 0), value)
    if c.load[i].type == FORCE:
        return port, (zero, value)
    return port, (value, zero)


@helper
def steiner(a, b):
    """(a . b) 1 - (a b + b a)/2, symmetric: for a = b, G (98) of a unit mass at a."""
    return (
        a[1] * b[1] + a[2] * b[2],
        a[0] * b[0] + a[2] * b[2],
        a[0] * b[0] + a[1] * b[1],
        -0.5 * (a[0] * b[1] + a[1] * b[0]),
        -0.5 * (a[0] * b[2] + a[2] * b[0]),
        -0.5 * (a[1] * b[2] + a[2] * b[1]),
    )


@helper
def store_sym6(a, i, s):
    """Store a symmetric 6-tuple."""
    for n in range(6):
        a[i + n] = s[n]
