"""Dry friction along a coordinate, after Hess and Soom (1990), smooth through zero.

    [Fc + (Fs - Fc) / (1 + (v/vs)^2)] v / sqrt(v^2 + vr^2)

with sliding friction Fc, static friction Fs, Stribeck speed vs and smoothing speed vr, in this order its parameters.
"""

from flexmb.connectors.law import CoordinateLaw
from flexmb.jit.kernel import helper
from flexmb.scene.connectors import AlongHinge, HingeFriction, by_stem
from flexmb.spatial.scalar import sqrt


@helper
def load(parameters, q, v):
    sliding, smoothing, ratio = parameters[0], parameters[3], v / parameters[2]
    level = sliding + (parameters[1] - sliding) / (1.0 + ratio * ratio)
    resisting = level * v / sqrt(v * v + smoothing * smoothing)
    return -resisting, 0.0 * v, -resisting * v


def parameters(connector: AlongHinge) -> tuple[float, ...] | None:
    """Of friction; without a static value it is that of sliding at every speed."""
    if not isinstance(connector, HingeFriction):
        return None
    law = by_stem(connector)
    static = law["sliding"] if law["static"] is None else law["static"]
    stribeck = 1.0 if law["stribeck"] is None else law["stribeck"]
    return law["sliding"], static, stribeck, law["smoothing"]


LAW = CoordinateLaw("friction", load, parameters)
