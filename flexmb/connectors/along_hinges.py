"""Connectors along scalar coordinates: nonlinear springs with stops and actuators, and dry friction.

A stop at the depth d, increasing at the rate d', exerts k d (1 + e d'), Hunt and Crossley (1975), and never pulls. The
load is continuous at any speed of contact, because it is proportional to d. Friction, Hess and Soom (1990), is smooth
at zero speed:

    [Fc + (Fs - Fc) / (1 + (v/vs)^2)] v / sqrt(v^2 + vr^2)
"""

from flexmb.connectors.laws import resistance
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.jit.lanes import select
from flexmb.spatial.scalar import sqrt
from flexmb.tables.features import FRICTION, HINGE_ACTUATORS, HINGE_SPRINGS


@helper
def add_loads_along_hinges(c, w):
    """Add the loads of all springs and friction along coordinates to w.speed.applied."""
    evaluate_along_hinges(c, w)
    for i in range(c.hinge_spring.shape[0]):
        w.speed[c.hinge_spring[i].speed].applied += w.hinge_spring[i].load
    for i in range(c.friction.shape[0]):
        w.speed[c.friction[i].speed].applied += w.friction[i].load


@helper
def evaluate_along_hinges(c, w):
    """Write loads, energies and powers of all springs and friction to w.hinge_spring and w.friction."""
    if has(c, HINGE_SPRINGS):
        for i in range(c.hinge_spring.shape[0]):
            _spring(c, w, i)
    if has(c, FRICTION):
        for i in range(c.friction.shape[0]):
            _friction(c, w, i)


@helper
def _spring(c, w, i):
    j = c.hinge_spring[i].speed
    q, v = w.q[c.speed[j].coordinate], w.u[j]
    elastic, energy = resistance(q - c.hinge_spring[i].rest, c.law, c.hinge_spring[i].start, c.hinge_spring[i].stop)
    lower, upper, k = c.hinge_spring[i].lower, c.hinge_spring[i].upper, c.hinge_spring[i].stop_stiffness
    # 0.0 * q is a zero of q's own type: a float, a dual number or lanes.
    beyond = select(q.real > upper, q - upper, select(q.real < lower, q - lower, 0.0 * q))
    pressing = 1.0 + c.hinge_spring[i].stop_dissipation * select(q.real < lower, -v, v)
    pushed = k * beyond * select(pressing.real > 0.0, pressing, 0.0 * pressing)
    # The elastic part k `beyond` of the stop's load has an energy; all else of it is dissipation, so part of the work.
    lost = c.hinge_spring[i].damping * v + (pushed - k * beyond)
    w.hinge_spring[i].load = -(elastic + k * beyond + lost)
    w.hinge_spring[i].energy = energy + 0.5 * k * beyond * beyond
    w.hinge_spring[i].power = -lost * v
    if has(c, HINGE_ACTUATORS):
        f = c.hinge_spring[i].function
        if f >= 0:
            w.hinge_spring[i].load += w.function[f, 0]
            w.hinge_spring[i].power += w.function[f, 0] * v


@helper
def _friction(c, w, i):
    v, smoothing = w.u[c.friction[i].speed], c.friction[i].smoothing
    sliding, ratio = c.friction[i].sliding, v / c.friction[i].stribeck
    level = sliding + (c.friction[i].static - sliding) / (1.0 + ratio * ratio)
    load = level * v / sqrt(v * v + smoothing * smoothing)
    w.friction[i].load = -load
    w.friction[i].energy = 0.0
    w.friction[i].power = -load * v


@helper
def stored_along_hinges(c, w):
    """Energy in J at the last evaluation."""
    total = 0.0
    for i in range(c.hinge_spring.shape[0]):
        total += w.hinge_spring[i].energy
    return total


@helper
def power_along_hinges(c, w):
    """Power in W of dampers, stops, actuators and friction at the last evaluation."""
    total = 0.0
    for i in range(c.hinge_spring.shape[0]):
        total += w.hinge_spring[i].power
    for i in range(c.friction.shape[0]):
        total += w.friction[i].power
    return total
