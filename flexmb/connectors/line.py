"""Springs, dampers and actuators along the line from A to B.

With d = p_B - p_A, length L = sqrt(d.d + s^2) and direction n = d/L, whose rate is L' = n . (v_B - v_A), the tension is
T = F(L - L0) + c L' - f, and the load on B is -T n. The smoothing s, a hundred-millionth of the free length, gives the
line a direction where its ends meet: the load vanishes there, and stays the derivative of the energy.
"""

from flexmb.connectors.laws import resistance
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.jit.lanes import select
from flexmb.spatial.scalar import sqrt
from flexmb.spatial.spatial_vector import store6
from flexmb.spatial.vector import dot, scale, store3, sub
from flexmb.tables.arrays import COMPRESSION, TENSION
from flexmb.tables.features import ACTUATORS, ONE_SIDED


@helper
def load_along_line(c, w, i, A, B):
    """Load, energy and power of connector i into w.connector[i], from (position, rotation, velocity) of A and B."""
    d, smoothing = sub(B[0], A[0]), c.connector[i].smoothing
    length = sqrt(dot(d, d) + smoothing * smoothing)
    n = scale(1.0 / length, d)
    rate = dot(n, sub(B[2][1], A[2][1]))
    extension = length - c.connector[i].free_length
    elastic, energy = resistance(extension, c.law, c.connector[i].start, c.connector[i].stop)
    tension = elastic + c.connector[i].damping * rate
    if has(c, ONE_SIDED):
        tension = _while_loaded(c.connector[i].acts, elastic, tension)
    if has(c, ACTUATORS):
        f = c.connector[i].function
        if f >= 0:
            tension = tension - w.function[f, 0]
    store6(w.connector[i].load, 0, ((0.0, 0.0, 0.0), scale(-tension, n)))
    store3(w.connector[i].arm, 0, d)
    w.connector[i].energy = energy
    w.connector[i].power = (elastic - tension) * rate


@helper
def _while_loaded(acts, elastic, tension):
    """The tension of what neither damps while it is slack nor pushes where it may only pull."""
    if acts == TENSION:
        return select((elastic.real > 0.0) & (tension.real > 0.0), tension, 0.0)
    if acts == COMPRESSION:
        return select((elastic.real < 0.0) & (tension.real < 0.0), tension, 0.0)
    return tension
