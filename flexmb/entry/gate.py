"""A fast path from Python to the accelerations of an algorithm: one compiled call that checks, evaluates and checks.

The gate is a builtin function of the interpreter, compiled once for all algorithms and scenes; it calls the kernel by
address. If any check fails, it calls a Python function (`careful`) with the same arguments, which evaluates again and
raises the appropriate error.

The workspace behind a gate belongs to one thread, because a long kernel releases the interpreter's lock while it
writes. The gate compares the number of the calling thread (2 ns), and passes calls of other threads to `careful`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from threading import RLock
from typing import Any, NamedTuple

import numpy as np

from flexmb.forks import fork_waits_for
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
    this_thread,
    value,
    vector,
    word_at,
)
from flexmb.jit.pointer import STATUS
from flexmb.tables.arrays import SPEED_STATE
from flexmb.tables.soundness import SOUND, soundness
from flexmb.tables.status import OK
from flexmb.typing import Index, Real, Record

NOBODY = -1  # no thread has this number

# Held while `builtin` registers a kernel that is new to it. Nothing in between takes another lock. Forking waits for
# it, because a lock that is held during a fork is never released in the child.
_making = RLock()
fork_waits_for(_making)

_UNLOCKED_FROM = 50  # speeds: from so many on the kernel releases the interpreter's lock, which costs 50 ns


@bundle
class Gate:
    """The data of a gate; speed and doubt are arrays of the workspace of its kernel."""

    quaternions: Index  # (k,) where each starts in q
    y: Real  # (nq+nu+1,) [q, u, 0]
    rates: Real  # (nu,) udot
    speed: Record  # (nu,) SPEED_STATE, where the kernel leaves udot
    doubt: Index  # (1,)
    behind: Index  # (3 or 4,) addresses of the kernel and of its arguments after t and y
    owner: Index  # (1,) number of the thread that may pass, or NOBODY
    returned: Index  # (1,) address of the array object that is returned
    careful: Index  # (1,) address of the Python function that is called if a check fails
    python: Index  # `flexmb.jit.objects.interpreter`


class GateNotes(NamedTuple):
    """State shared by a gate and its Python function.

    owner (1,): number of the thread that the gate is for, or NOBODY; returned (1,): address of the array that is
    returned, a view of the rates to which the Python function holds a reference.
    """

    owner: Index
    returned: Index


def gate(
    quaternions: Index, rates: Real, nq: int, speed: Record, doubt: Index, behind: Sequence[int], notes: GateNotes,
    careful: Any,
) -> Callable[..., Real]:  # fmt: skip
    """A function of (t, q, u) that returns the rates (nu,), in an array that every call overwrites.

    If a check fails, it returns careful(t, q, u). speed and doubt are arrays of the workspace of the kernel.
    """
    passed = _gate(quaternions, rates, nq, speed, doubt, behind, notes, id(careful))
    address = _address()
    with _making:
        return builtin(address, passed, careful)


@cache
def _address() -> int:
    """The address of `evaluate`, compiled once for all gates."""
    signature = STATUS(*[STATUS] * 4)
    evaluate.compile(signature.args)
    return HOOKS.address(evaluate, signature)


def _gate(
    quaternions: Index, rates: Real, nq: int, speed: Record, doubt: Index, behind: Sequence[int], notes: GateNotes,
    careful: int,
) -> Gate:  # fmt: skip
    y, (kernel_and_tables, function) = np.zeros(nq + len(rates) + 1), map(_whole, (behind, [careful]))
    return Gate(quaternions, y, rates, speed, doubt, kernel_and_tables, *notes, function, interpreter())


def _whole(numbers: Sequence[int]) -> Index:
    return np.array(numbers, np.int64)


_NOTHING = np.zeros(0, np.int64)
_NO_NOTES = GateNotes(_NOTHING, _NOTHING)
gate_at = at_address(_gate(_NOTHING, np.zeros(0), 0, np.zeros(0, SPEED_STATE), _NOTHING, (), _NO_NOTES, 0))


@kernel
def evaluate(place, arguments, count, names):
    """The builtin function of t, q (nq,) and u (nu,) that returns the rates of the gate at this address."""
    g = gate_at(bundle_of(place))
    passes = _is_owner(g) and count == 3 and names == 0 and _admitted(arguments, g)
    if passes and _evaluated(arguments, g) and _sound(g) and _is_plain(g.returned[0], g):
        return taken(g.python, g.returned[0])
    return called(g.python, g.careful[0], arguments, count, names)


@helper
def _is_owner(g):
    """Whether the calling thread is the first that called this gate. It holds the interpreter's lock: no race here."""
    this = this_thread(g.python)
    if g.owner[0] == NOBODY:
        g.owner[0] = this
    return g.owner[0] == this


@helper
def _is_plain(x, g):
    """Whether the returned array still has its shape, which the user could change in place."""
    return is_vector(g.python, x) and vector(x).shape[0] == g.rates.shape[0]


@helper
def _admitted(arguments, g):
    """Whether time and state are valid; if so, the state is in g.y."""
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
    """Whether the kernel returns OK."""
    t = value(word_at(arguments, 0))
    if g.rates.shape[0] < _UNLOCKED_FROM:
        return _status(t, g) == OK
    thread = status_at(g.python[SAVE], ())
    status = _status(t, g)
    nothing_at(g.python[RESTORE], (thread,))
    return status == OK


@helper
def _status(t, g):
    """The status that the kernel returns."""
    function, c, w = g.behind[0], g.behind[1], g.behind[2]
    if g.behind.shape[0] == 3:
        return status_at(function, (t, g.y, c, w))
    return status_at(function, (t, g.y, c, w, g.behind[3]))


@helper
def _sound(g):
    """Whether the rates are finite and no pivot was doubtful; copies the rates to g.rates."""
    sound = g.doubt[0] == 0
    for j in range(g.rates.shape[0]):
        rate = g.speed[j].acceleration
        sound &= math.isfinite(rate)
        g.rates[j] = rate
    return sound
