"""Controllers in dual numbers, which carry derivatives: the helpers of `flexmb.control.loop` on a `LoopVariation`.

Sampled controllers act in the first evaluation at their instant, as in the loop of floats: the derivatives of their
states and of the outputs that they hold change there by the chain rule.
"""

from __future__ import annotations

from flexmb.control import loop
from flexmb.jit.kernel import kernel
from flexmb.tables.status import OK


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
