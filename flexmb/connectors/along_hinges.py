"""Connectors along scalar coordinates: nonlinear springs with stops and actuators, and the laws of `catalogue`.

A stop at depth d, pressed in at the rate d', pushes back by k d (1 + e d'), Hunt and Crossley (1975), and never pulls:
the load starts from zero however fast it is met.
"""

from flexmb.connectors import catalogue
from flexmb.connectors.laws import resistance
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.jit.lanes import select
from flexmb.tables.features import COORDINATE_LAWS, HINGE_ACTUATORS, HINGE_SPRINGS


@helper
def add_loads_along_hinges(c, w):
    """Add the loads of all springs and laws along coordinates to w.speed.applied."""
    evaluate_along_hinges(c, w)
    for i in range(c.hinge_spring.shape[0]):
        w.speed[c.hinge_spring[i].speed].applied += w.hinge_spring[i].load
    for i in range(c.coordinate_law.shape[0]):
        w.speed[c.coordinate_law[i].speed].applied += w.coordinate_law[i].load


@helper
def evaluate_along_hinges(c, w):
    """Write loads, energies and powers of all springs and laws to w.hinge_spring and w.coordinate_law."""
    if has(c, HINGE_SPRINGS):
        for i in range(c.hinge_spring.shape[0]):
            _spring(c, w, i)
    if has(c, COORDINATE_LAWS):
        for i in range(c.coordinate_law.shape[0]):
            _law(c, w, i)


@helper
def _spring(c, w, i):
    j = c.hinge_spring[i].speed
    q, v = w.q[c.speed[j].coordinate], w.u[j]
    elastic, energy = resistance(q - c.hinge_spring[i].rest, c.law, c.hinge_spring[i].start, c.hinge_spring[i].stop)
    lower, upper, k = c.hinge_spring[i].lower, c.hinge_spring[i].upper, c.hinge_spring[i].stop_stiffness
    # 0.0 * q is a zero of q's own type: a float, a dual number or lanes.
    beyond = select(q.real > upper.real, q - upper, select(q.real < lower.real, q - lower, 0.0 * q))
    pressing = 1.0 + c.hinge_spring[i].stop_dissipation * select(q.real < lower.real, -v, v)
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
def _law(c, w, i):
    j, kind = c.coordinate_law[i].speed, c.coordinate_law[i].kind
    load = catalogue.load(c, kind, c.coordinate_law[i].parameters, w.q[c.speed[j].coordinate], w.u[j])
    w.coordinate_law[i].load = load[0]
    w.coordinate_law[i].energy = load[1]
    w.coordinate_law[i].power = load[2]


@helper
def stored_along_hinges(c, w):
    """Energy in J at the last evaluation."""
    total = 0.0
    for i in range(c.hinge_spring.shape[0]):
        total += w.hinge_spring[i].energy
    if has(c, COORDINATE_LAWS):
        for i in range(c.coordinate_law.shape[0]):
            total += w.coordinate_law[i].energy
    return total


@helper
def power_along_hinges(c, w):
    """Power in W of dampers, stops, actuators and laws at the last evaluation."""
    total = 0.0
    for i in range(c.hinge_spring.shape[0]):
        total += w.hinge_spring[i].power
    for i in range(c.coordinate_law.shape[0]):
        total += w.coordinate_law[i].power
    return total
