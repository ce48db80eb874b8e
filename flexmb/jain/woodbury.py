"""D_f^-1 of a ruthless body without factorising D_f: (B2)-(B4), corrected.

(B3) as printed inverts Gamma, which a hinge makes singular (its rank is at most 6 - n_r). Used here is

    D_f^-1 = Lam - Ups T Ups',   T = (1 + Gamma Omega)^-1 Gamma,

with the constants Lam = M_ff^-1, Ups = Lam Pi', Omega = Pi Ups of (B4). All else is (63), (64) as printed.
"""

from flexmb.jain.explicit import refer_coupling, refer_rigid
from flexmb.jain.forces import add_port_force
from flexmb.jain.ports import mode_motion
from flexmb.jain.reduced import node_inertia
from flexmb.jit.kernel import helper
from flexmb.spatial.inertia import add_inertia, add_product, inertia_times, load_inertia, shift_inertia
from flexmb.spatial.rows import column6
from flexmb.spatial.spatial_vector import add6, dot6, shift_force, store6, vec6
from flexmb.spatial.vector import vec3


@helper
def eliminate_modes(c, w, k):
    """P_R = P_rr - g mu', z_R = z_r + g epsilon_f of (63), (64) with g = mu D_f^-1, which stays in w.gain.

    D_f^-1 is that of (B3), corrected. Returns False if T does not exist.
    """
    r = c.body[k].reduced
    nm = c.body[k].modes
    for n in range(nm):
        store6(w.pfr[k, n], 0, column6(c.mfr[k], n))
    if not node_inertia(w, r, c.body[k].nodes):
        return False
    for i in range(c.body[k].nodes):
        _load_node(c, w, k, i)
    # P_fr and P_rr are referred to O; the constants of (B4), from which D_f^-1 is computed, are about O already.
    if c.body[k].outboard_port >= 0:
        refer_coupling(c, w, k, -1.0)
        refer_rigid(c, w, k)
    _inverse(c, w, k)
    for b in range(21):
        w.body[k].hinge_inertia[b] = w.body[k].inertia[b]
    store6(w.body[k].hinge_force, 0, vec6(w.body[k].force, 0))
    for n in range(nm):
        g = w.gain[r, 0, n]
        for b in range(6):
            g[b] = 0.0
        for i in range(nm):
            for b in range(6):
                g[b] += w.pff[k, n, i] * w.pfr[k, i, b]
        add_product(w.body[k].hinge_inertia, 0, -1.0, g, w.pfr[k, n])
        for b in range(6):
            w.body[k].hinge_force[b] -= g[b] * w.zf[k, n]
    return True


@helper
def _load_node(c, w, k, i):
    """Add the outboard body at node i: z += A z_R^+, and P += A Gamma A' without the ff block, which is in T."""
    node = w.node[c.body[k].reduced, i]
    port = c.node[c.body[k].reduced, i].port
    r = vec3(w.port[port].r, 0)
    gamma = load_inertia(node.gamma, 0)
    for n in range(c.body[k].modes):
        add6(w.pfr[k, n], 0, shift_force(inertia_times(gamma, mode_motion(w, port, n)), r))
    add_inertia(w.body[k].inertia, 0, shift_inertia(gamma, r))
    add_port_force(c, w, w, k, port, vec6(node.force, 0))


@helper
def _inverse(c, w, k):
    """D_f^-1 = Lam - Ups T Ups' to w.pff[k]: (B3), corrected."""
    r = c.body[k].reduced
    nodes = c.body[k].nodes
    T = w.scratch[2]
    row = w.scratch[0, 0]
    for n in range(c.body[k].modes):
        for i in range(nodes):
            for a in range(6):
                s = 0.0
                for j in range(nodes):
                    for b in range(6):
                        s += T[6 * i + a, 6 * j + b] * w.gain[r, 1 + j, n, b]
                row[6 * i + a] = s
        for i in range(n + 1):
            s = c.compliance[r, n, i]
            for j in range(nodes):
                for b in range(6):
                    s -= row[6 * j + b] * w.gain[r, 1 + j, i, b]
            w.pff[k, n, i] = s
            w.pff[k, i, n] = s


@helper
def modal_accelerations(c, w, k, A):
    """etadd = nu_f - g' alpha, alpha being the acceleration A of O: outward half of (64)."""
    r = c.body[k].reduced
    for n in range(c.body[k].modes):
        s = dot6(vec6(w.gain[r, 0, n], 0), A)
        for i in range(c.body[k].modes):
            s += w.pff[k, n, i] * w.zf[k, i]
        w.etadd[k, n] = -s
        w.speed[c.body[k].etad_index + n].acceleration = -s
