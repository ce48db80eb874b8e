"""Springs, dampers and actuators along the line from A to B.

With d = p_B - p_A, the length L = sqrt(d.d + s^2), its rate L' = n . (v_B - v_A) and n = d/L, the tension is
T = F(L - L0) + c L' - f, and the load on B is -T n. The smoothing length s (`flexmb.building.connector_arrays`) makes n
continuous where the ends meet: the load vanishes there, and its elastic part remains the derivative of the energy.
"""

from flexmb.connectors.law import FrameLaw
from flexmb.connectors.laws import resistance
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.jit.lanes import select
from flexmb.scene.connectors import BetweenNodes, SpringDamper
from flexmb.spatial.scalar import sqrt
from flexmb.spatial.spatial_vector import store6
from flexmb.spatial.vector import dot, scale, store3, sub
from flexmb.tables.arrays import COMPRESSION, TENSION
from flexmb.tables.features import ACTUATORS, ONE_SIDED


@helper
def load_along_line(c, w, i, A, B):
    """Write load, energy and power of connector i to w.connector[i].

    A and B are (position, rotation, velocity) of the two frames, World axes.
    """
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
    """The tension of a one-sided connector: zero while it is slack, and where damping would reverse its sign."""
    # `select` in place of `if`: in lanes each copy decides for itself. `.real` is the value of a dual number.
    if acts == TENSION:
        return select((elastic.real > 0.0) & (tension.real > 0.0), tension, 0.0)
    if acts == COMPRESSION:
        return select((elastic.real < 0.0) & (tension.real < 0.0), tension, 0.0)
    return tension


def parameters(connector: BetweenNodes) -> tuple[float, ...] | None:
    """None beside the columns that the table of connectors has for springs."""
    return () if isinstance(connector, SpringDamper) else None


LAW = FrameLaw("line", load_along_line, parameters)
