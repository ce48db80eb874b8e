"""Controllers in dual numbers, which carry derivatives: the helpers of `flexmb.control.loop` on a `LoopVariation`.

Sampled controllers act in the first evaluation at their instant, as in the loop of floats: the derivatives of their
states and of the outputs that they hold change there by the chain rule.
"""

from __future__ import annotations

import numpy as np

from flexmb.control import loop
from flexmb.control.tables import Loop, PlainLaw
from flexmb.jit.kernel import kernel
from flexmb.tables.status import OK


def plain_laws(made: Loop) -> PlainLaw:
    """The arrays of floats in which the laws of a loop look."""
    most = int(np.max(made.controller["outputs"] + made.controller["states"], initial=0))
    return PlainLaw(
        input=made.input, state=made.state, number=made.number, output=made.output, change=made.change,
        value=np.zeros(most), coarse=np.zeros(most), fine=np.zeros(most), bend=np.zeros(most), less_bend=np.zeros(most),
    )  # fmt: skip


@kernel
def steer(t, s):
    """Sampled controllers up to t, then the drives of the motion at s.y and s.state; returns a status code."""
    return loop.set_drives(t, s)


@kernel
def follow(t, s):
    """The rates of controllers that read what depends on the forces, after the motion; returns a status code."""
    return loop.follow(t, s)


@kernel
def begin(t, s):
    """The states of continuous controllers at the start of a run."""
    loop.begin_laws(t, s)


@kernel
def look(t, s):
    """All signals at s.y and s.state, as at an output time; returns a status code."""
    status = loop.set_drives(t, s)
    return loop.sense(t, s) if status == OK else status
