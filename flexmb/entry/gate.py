"""A gate between Python and the kernel of an algorithm's accelerations: one call that checks, evaluates and checks.

Compiled once for all algorithms and scenes: the kernel behind it is called by address, and the gate itself is a
function of the interpreter. Whatever is not plainly right, it leaves to a function of Python, which finds out what to
say.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from flexmb.jit.bundle import bundle
from flexmb.jit.direct import at_address, nothing_at, status_at
from flexmb.jit.hooks import HOOKS
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.objects import (
    RESTORE,
    SAVE,
    builtin,
    bundle_of,
    called,
    interpreter,
    is_float,
    is_vector,
    taken,
    value,
    vector,
    word_at,
)
from flexmb.jit.pointer import STATUS
from flexmb.tables.arrays import SPEED_STATE
from flexmb.tables.soundness import SOUND, soundness
from flexmb.tables.status import OK
from flexmb.typing import Index, Real, Record

_LONG = 50  # speeds from which other threads may run meanwhile: letting them costs 50 ns


@bundle
class Gate:
    """What passes the gate; speed and doubt are those of the workspace of the kernel behind it."""

    quaternions: Index  # (k,) where each starts in q
    y: Real  # (nq+nu+1,) [q, u, 0]
    rates: Real  # (nu,) udot
    speed: Record  # (nu,) SPEED_STATE, where the kernel leaves udot
    doubt: Index  # (1,)
    behind: Index  # (3 or 4,) addresses of the kernel, and of the bundles that it takes after t and y
    objects: Index  # (2,) of what is returned, and of the function that is called instead
    python: Index  # `flexmb.jit.objects.interpreter`


def gate(
    quaternions: Index, rates: Real, nq: int, speed: Record, doubt: Index, behind: Sequence[int], careful: Any
) -> Callable[..., Real]:
    """(t, q, u): rates (nu,), which every call writes anew, or what `careful` makes of these arguments.

    speed and doubt are those of the workspace of the kernel behind the gate.
    """
    passed = _gate(quaternions, rates, nq, speed, doubt, behind, (id(rates), id(careful)))
    signature = STATUS(*[STATUS] * 4)
    evaluate.compile(signature.args)
    return builtin(HOOKS.address(evaluate, signature), passed, rates, careful)


def _gate(
    quaternions: Index, rates: Real, nq: int, speed: Record, doubt: Index, behind: Sequence[int], objects: Sequence[int]
) -> Gate:
    y, addresses = np.zeros(nq + len(rates) + 1), (np.array(each, np.int64) for each in (behind, objects))
    return Gate(quaternions, y, rates, speed, doubt, *addresses, interpreter())


_NOTHING = np.zeros(0, np.int64)
gate_at = at_address(_gate(_NOTHING, np.zeros(0), 0, np.zeros(0, SPEED_STATE), _NOTHING, (), ()))


@kernel
def evaluate(place, arguments, count, names):
    """A builtin of t, q (nq,) and u (nu,): the rates of the gate at this place."""
    g = gate_at(bundle_of(place))
    if count == 3 and names == 0 and _admitted(arguments, g) and _evaluated(arguments, g) and _sound(g):
        return taken(g.python, g.objects[0])
    return called(g.python, g.objects[1], arguments, count, names)


@helper
def _admitted(arguments, g):
    """Whether time and state can be used; they are in g.y then."""
    t, q, u = word_at(arguments, 0), word_at(arguments, 1), word_at(arguments, 2)
    if not (is_float(g.python, t) and is_vector(g.python, q) and is_vector(g.python, u)):
        return False
    q, u = vector(q), vector(u)
    nq, nu = q.shape[0], u.shape[0]
    if nu != g.rates.shape[0] or nq + nu + 1 != g.y.shape[0] or not math.isfinite(value(t)):
        return False
    for i in range(nq):
        g.y[i] = q[i]
    for j in range(nu):
        g.y[nq + j] = u[j]
    return soundness(g.y, g.quaternions) == SOUND


@helper
def _evaluated(arguments, g):
    """Whether the kernel says that all went well."""
    t = value(word_at(arguments, 0))
    if g.rates.shape[0] < _LONG:
        return _status(t, g) == OK
    thread = status_at(g.python[SAVE], ())
    status = _status(t, g)
    nothing_at(g.python[RESTORE], (thread,))
    return status == OK


@helper
def _status(t, g):
    """Of the kernel."""
    function, c, w = g.behind[0], g.behind[1], g.behind[2]
    if g.behind.shape[0] == 3:
        return status_at(function, (t, g.y, c, w))
    return status_at(function, (t, g.y, c, w, g.behind[3]))


@helper
def _sound(g):
    """Whether the rates, which are in g.rates then, are finite and beyond doubt."""
    sound = g.doubt[0] == 0
    for j in range(g.rates.shape[0]):
        rate = g.speed[j].acceleration
        sound &= math.isfinite(rate)
        g.rates[j] = rate
    return sound
