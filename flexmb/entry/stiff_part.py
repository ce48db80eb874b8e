"""The stiff part of the equations of motion for implicit methods, solved by the recursion in O(N).

Let K and D be the derivatives of the elastic and damping forces of modes, and of the springs, dampers and laws of
hinges, by the coordinates and the speeds that they belong to. They are block diagonal, so that

    E = M + a D + b K

is the mass matrix of the same tree with other modal masses and armatures. The articulated-body elimination of Jain &
Rodriguez factorises it, for complex a and b too (the method of Radau IIA has a complex pair): no Jacobian is formed,
and nothing is cubic in the number of bodies. What is left out, the derivatives of inertial forces, gravity and node
loads, limits the convergence of Newton's method and nothing else: the equations that it solves are the exact ones.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from flexmb.entry import factorisation
from flexmb.entry.tangent import TangentWorkspace, tangent_workspace
from flexmb.jain import innovations
from flexmb.jain.response import Response, response
from flexmb.jain.sweeps import inward
from flexmb.jit.bundle import bundle
from flexmb.jit.complex_numbers import COMPLEX
from flexmb.jit.duals import rate, seeded
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.wide_arrays import as_complex
from flexmb.motion.coordinates import configuration_rate, hinge_forces, load_state
from flexmb.tables.arrays import Constants, Workspace
from flexmb.tables.features import ARMATURES
from flexmb.tables.one_buffer import in_one_buffer, places
from flexmb.tables.status import NOT_CONVERGED, OK
from flexmb.tables.workspaces import workspace
from flexmb.typing import Index, Real

BY_COORDINATES, BY_SPEEDS = range(2)  # lanes of the derivatives of hinge forces


@bundle
class ShiftedConstants(Constants):
    """Constants whose modal masses and armatures are those of E."""

    numbers = COMPLEX

    def features(self) -> frozenset[str]:
        """Armatures at all hinges."""
        return super().features() | {ARMATURES}


@bundle
class ShiftedWorkspace(Workspace):
    """A workspace for the factors of E."""

    numbers = COMPLEX


@bundle
class ShiftedResponse(Response):
    """Right-hand sides and solutions of E x = T."""

    numbers = COMPLEX


@bundle
class Shifted:
    """E, its factors, and a response to these."""

    c: ShiftedConstants
    w: ShiftedWorkspace
    x: ShiftedResponse
    numbers: Real  # of w, all of them
    place: Index  # (n,) in these, of the real part of each number of `StiffPart.plain`


@bundle
class StiffPart:
    """The stiff part at the state (t, y) where `settle_at` has put it, with two matrices E of a and b each."""

    scene: Constants
    tangent: TangentWorkspace
    plain: Workspace  # with the configuration and M_m of every body, which are real
    numbers: Real  # of this workspace, all of them
    place: Index  # (n,) in these, of each number
    first: Shifted
    second: Shifted
    time: Real  # (1,) s
    state: Real  # (nq+nu+1,) y
    stiffness: Real  # (nu,) of hinges, by speed; zero for modes and wheels
    damping: Real  # (nu,) likewise
    hinged: Index  # (nu,) whether a speed is one of a hinge, and free


def is_complete(c: Constants) -> bool:
    """Whether all elastic forces of a scene belong to modes and to scalar coordinates of hinges."""
    turned = c.speed["stiffness"][c.wheel["u_index"]]  # springs of wheels; their friction is left out, as it is weak
    return len(c.connector) == 0 and not np.any(c.body["ball_spring"]) and not np.any(turned)


def stiff_part(c: Constants, nq: int, nu: int) -> StiffPart:
    """Tables for a scene; one per thread."""
    hinged = np.zeros(nu, np.int64)
    for body in c.body:
        hinged[body["u_index"] : body["u_index"] + body["nv"]] = 1
    hinged[c.speed["prescribed"] >= 0] = 0
    plain, numbers = in_one_buffer(workspace(c, nq, nu))
    place = places(plain, numbers, plain)
    first, second = (_shifted(c, plain) for _ in range(2))
    return StiffPart(
        scene=c, tangent=tangent_workspace(c, nq, nu), plain=plain, numbers=numbers, place=place, first=first,
        second=second, time=np.zeros(1), state=np.zeros(nq + nu + 1), stiffness=np.zeros(nu), damping=np.zeros(nu),
        hinged=hinged,
    )  # fmt: skip


def _shifted(c: Constants, plain: Workspace) -> Shifted:
    answers = response(c)
    w = ShiftedWorkspace(**{field.name: as_complex(getattr(plain, field.name)) for field in fields(plain)})
    w, numbers = in_one_buffer(w)
    return Shifted(
        c=ShiftedConstants(**{field.name: as_complex(getattr(c, field.name)) for field in fields(c)}),
        w=w,
        x=ShiftedResponse(**{field.name: as_complex(getattr(answers, field.name)) for field in fields(answers)}),
        numbers=numbers,
        place=places(w, numbers, plain),
    )


@kernel
def settle_at(t, y, s):
    """Take the stiff part at time t and y = [q, u, work]; factors are those of other states until `shift`."""
    s.time[0] = t
    for i in range(y.shape[0]):
        s.state[i] = y[i]
    c, w = s.scene, s.tangent
    load_state(t, s.state, c, w)
    for j in range(w.u.shape[0]):
        i = c.speed[j].coordinate
        if i >= 0:
            w.q[i] = seeded(w.q[i], BY_COORDINATES)
        w.u[j] = seeded(w.u[j], BY_SPEEDS)
    hinge_forces(c, w)
    for j in range(w.u.shape[0]):
        s.stiffness[j] = -rate(w.speed[j].applied, BY_COORDINATES) if s.hinged[j] == 1 else 0.0
        s.damping[j] = -rate(w.speed[j].applied, BY_SPEEDS) if s.hinged[j] == 1 else 0.0
    load_state(t, s.state, c, s.plain)
    innovations.inertias(c, s.plain)
    return OK


@kernel
def shift(a, b, second, s):
    """Factorise E for a (s) and b (s^2), as the first or the second matrix; returns a status code.

    The matrix is chosen before the call: calls in two branches would have the whole factorisation in the kernel twice.
    """
    return _factorise(a, b, s, s.second if second else s.first)


@helper
def _factorise(a, b, s, m):
    """NOT_CONVERGED where E has no factors: a shorter step may have.

    The masses, which are real, are those that `settle_at` has left: complex numbers begin with the elimination.
    """
    c = s.scene
    for i in range(m.place.shape[0]):
        m.numbers[m.place[i]] = s.numbers[s.place[i]]
        m.numbers[m.place[i] + 1] = 0.0
    for k in range(c.body.shape[0]):
        for n in range(c.body[k].modes):
            for i in range(c.body[k].modes):
                m.w.pff[k, n, i] += a * c.damping[k, n, i] + b * c.stiffness[k, n, i]
    for j in range(c.speed.shape[0]):
        m.c.speed[j].armature = c.speed[j].armature + a * s.damping[j] + b * s.stiffness[j]
    return OK if inward(m.c, m.w) else NOT_CONVERGED


@kernel
def along(u, q, s):
    """q (nq,) = the rates of the coordinates at speeds u (nu,), complex, at the state of `shift`.

    Those of prescribed coordinates are zero.
    """
    w = s.first.w
    for j in range(u.shape[0]):
        w.u[j] = u[j] if s.scene.speed[j].prescribed < 0 else 0.0 * u[j]
    configuration_rate(s.scene, w, w.rate)
    for i in range(q.shape[0]):
        q[i] = w.rate[i]


@kernel
def restore(q, u, second, s):
    """Replace u (nu,) by E^-1 (K q + D u), for changes q (nq,) of coordinates and u of speeds, complex."""
    _restore(q, u, s, s.second if second else s.first)


@helper
def _restore(q, u, s, m):
    c = s.scene
    for j in range(u.shape[0]):
        force = s.damping[j] * u[j]
        if c.speed[j].coordinate >= 0:
            force += s.stiffness[j] * q[c.speed[j].coordinate]
        m.x.speed[j] = force
    for k in range(c.body.shape[0]):
        first, place = c.body[k].eta_index, c.body[k].etad_index
        for n in range(c.body[k].modes):
            force = 0.0 * u[place]
            for i in range(c.body[k].modes):
                force += c.stiffness[k, n, i] * q[first + i] + c.damping[k, n, i] * u[place + i]
            m.x.speed[place + n] = force
    factorisation.answer(m.c, m.w, m.x)
    for j in range(u.shape[0]):
        u[j] = m.x.speed[j]
