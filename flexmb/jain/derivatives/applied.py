"""Derivatives of the forces along the speeds: of springs, dampers, stops and laws of hinges, each by its coordinate.

Because none depends on another hinge, one evaluation by duals finds them all: all scalar coordinates are changed along
one lane, all speeds along another, and the rotations of spherical hinges along three more.
"""

from flexmb.hinges import catalogue
from flexmb.jit.duals import rate, seeded
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.motion.coordinates import hinge_forces
from flexmb.tables.features import BALL_SPRINGS, COORDINATE_LAWS, DAMPERS, HINGE_SPRINGS, SPRINGS

COORDINATES, SPEEDS, ROTATIONS = 0, 1, 2  # lanes


@helper
def subtract_applied(c, w, d):
    """Subtract the derivatives of w.speed.applied from `matrix`."""
    if (has(c, BALL_SPRINGS) or has(c, HINGE_SPRINGS) or has(c, COORDINATE_LAWS)) and _are_laws(c):
        _by_duals(c, w, d)
        return
    nu = w.u.shape[0]
    for j in range(nu):
        place = d.place[j]
        if has(c, SPRINGS) and c.speed[j].coordinate >= 0:
            d.matrix[place, place] += c.speed[j].stiffness
        if has(c, DAMPERS):
            d.matrix[place, nu + place] += c.speed[j].damping


@helper
def _are_laws(c):
    """Whether there is more than springs and dampers of scalar coordinates, whose derivatives are known."""
    found = c.hinge_spring.shape[0] > 0 or c.coordinate_law.shape[0] > 0
    if has(c, BALL_SPRINGS):
        for k in range(c.body.shape[0]):
            found |= c.body[k].ball_spring != 0.0
    return found


@sweep
def _by_duals(c, w, d):
    differentiate_forces(c, w, d)
    e, nu = d.duals, w.u.shape[0]
    for j in range(nu):
        place = d.place[j]
        if c.speed[j].coordinate >= 0:
            d.matrix[place, place] -= rate(e.speed[j].applied, COORDINATES)
        d.matrix[place, nu + place] -= rate(e.speed[j].applied, SPEEDS)
    if has(c, BALL_SPRINGS):
        for k in range(c.body.shape[0]):
            if c.body[k].ball_spring != 0.0:
                for n in range(3):
                    place = d.places[k].hinge + n
                    for m in range(3):
                        change = rate(e.speed[c.body[k].u_index + n].applied, ROTATIONS + m)
                        d.matrix[place, d.places[k].hinge + m] -= change


@helper
def pull_applied(c, w, d, virtual, row):
    """Subtract virtual speeds (nu,) times the derivatives of w.speed.applied from a row (2nu,) in order of places."""
    nu = w.u.shape[0]
    if (has(c, BALL_SPRINGS) or has(c, HINGE_SPRINGS) or has(c, COORDINATE_LAWS)) and _are_laws(c):
        _pull_by_duals(c, w, d, virtual, row)
        return
    for j in range(nu):
        place = d.place[j]
        if has(c, SPRINGS) and c.speed[j].coordinate >= 0:
            row[place] += virtual[j] * c.speed[j].stiffness
        if has(c, DAMPERS):
            row[nu + place] += virtual[j] * c.speed[j].damping


@sweep
def _pull_by_duals(c, w, d, virtual, row):
    differentiate_forces(c, w, d)
    e, nu = d.duals, w.u.shape[0]
    for j in range(nu):
        place = d.place[j]
        if c.speed[j].coordinate >= 0:
            row[place] -= virtual[j] * rate(e.speed[j].applied, COORDINATES)
        row[nu + place] -= virtual[j] * rate(e.speed[j].applied, SPEEDS)
    if has(c, BALL_SPRINGS):
        for k in range(c.body.shape[0]):
            if c.body[k].ball_spring != 0.0:
                for n in range(3):
                    j = c.body[k].u_index + n
                    for m in range(3):
                        change = rate(e.speed[j].applied, ROTATIONS + m)
                        row[d.places[k].hinge + m] -= virtual[j] * change


@helper
def differentiate_forces(c, w, d):
    """w.speed.applied in dual numbers, as the lanes say, to the dual workspace."""
    e, nu = d.duals, w.u.shape[0]
    for i in range(w.q.shape[0]):
        e.q[i] = w.q[i]
    if has(c, BALL_SPRINGS):
        for k in range(c.body.shape[0]):
            if c.body[k].ball_spring != 0.0:
                _turn(c, d, k)
    for j in range(nu):
        i = c.speed[j].coordinate
        if i >= 0:
            e.q[i] = seeded(e.q[i], COORDINATES)
        e.u[j] = w.u[j]
        e.u[j] = seeded(e.u[j], SPEEDS)
    hinge_forces(c, e)


@helper
def _turn(c, d, k):
    """Turn the spherical hinge k about its three axes along three lanes."""
    e, i, j = d.duals, c.body[k].q_index, c.body[k].u_index
    for n in range(3):
        e.u[j + n] = 0.0
        e.u[j + n] = seeded(e.u[j + n], ROTATIONS + n)
    catalogue.rate(c, c.body[k].hinge_kind, e.q, i, e.u, j, e.rate)
    for m in range(4):
        e.q[i + m] += e.rate[i + m]
