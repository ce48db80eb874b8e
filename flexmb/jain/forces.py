"""Forces on bodies and modes besides those of inertia: elastic and modal damping forces, loads at nodes."""

from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.jit.strips import put, strip, width
from flexmb.spatial.rows import strips3, strips6
from flexmb.spatial.spatial_vector import add6, dot6, scale6, shift_force
from flexmb.spatial.vector import add3, dot, mat3, scale, times, times_t, vec3
from flexmb.tables.arrays import FORCE, NODE_AXES
from flexmb.tables.features import COUPLED_MODES, MODES


@helper
def elastic_forces(c, w, k):
    """Add K eta + D etadot to z_f, with the true deformation also at level ruthless, whose inertia ignores it."""
    nm, q, u = c.body[k].modes, c.body[k].eta_index, c.body[k].etad_index
    if not has(c, COUPLED_MODES) or c.body[k].uncoupled:  # K and D are diagonal, as of eigenmodes
        for n in range(nm):
            w.zf[k, n] += c.stiffness[k, n, n] * w.q[q + n] + c.damping[k, n, n] * w.u[u + n]
    else:
        for n in range(nm):
            s = w.zf[k, n]
            for i in range(nm):
                s += c.stiffness[k, n, i] * w.q[q + i] + c.damping[k, n, i] * w.u[u + i]
            w.zf[k, n] = s


@helper
def node_loads(c, w, k):
    """Subtract the loads at nodes from the bias force of body k."""
    for i in range(c.body[k].load_start, c.body[k].load_stop):
        port, F = load_at_port(c, w, k, i)
        add_port_force(c, w, w, k, port, scale6(-1.0, F))


@helper
def load_at_port(c, w, k, i):
    """Load i of body k: its port, and [torque; force] about the port in body axes."""
    port = c.load[i].port
    magnitude = w.function[c.load[i].function, 0]
    direction = vec3(c.load[i].direction, 0)
    if c.load[i].frame == NODE_AXES:
        value = scale(magnitude, times(mat3(w.port[port].R, 0), direction))
    else:
        value = scale(magnitude, times_t(mat3(w.body[k].pose_rotation, 0), direction))
    if c.load[i].type == FORCE:
        return port, ((0.0, 0.0, 0.0), value)
    return port, (value, (0.0, 0.0, 0.0))


@helper
def add_port_force(c, w, z, k, port, F):
    """z += A F with A = [Pi'; phi] of (14), (15): a force about a port of body k, for its modes and about its origin.

    z holds the forces: the workspace w itself, or a `Response` to the factors in w.
    """
    if has(c, MODES):
        for n in range(0, c.body[k].modes, width(w)):
            put(w, z.zf[k], n, strip(w, z.zf[k], n) + dot6(strips6(w, w.port_mode[port], n), F))
    add6(z.body[k].force, 0, shift_force(F, vec3(w.port[port].r, 0)))


@helper
def add_port_torque(c, w, z, k, port, torque):
    """z += A [torque; 0], like `add_port_force`."""
    add3(z.body[k].force, 0, torque)
    if has(c, MODES):
        for n in range(0, c.body[k].modes, width(w)):
            put(w, z.zf[k], n, strip(w, z.zf[k], n) + dot(strips3(w, w.port_mode[port], 0, n), torque))
