"""Entry point of the underactuated problem: modal accelerations for given accelerations of hinges and wheels.

Jain & Rodriguez, after (45): generalised forces act on hinges only, so that T^f = 0 determines the modal accelerations.
They follow from the articulated recursion with every hinge and wheel prescribed, O(N).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexmb.jain.sweeps import forward_dynamics
from flexmb.jit.kernel import kernel
from flexmb.motion.coordinates import load_state
from flexmb.tables.arrays import FUNCTION, Constants, Workspace


@kernel
def consistent_accelerations(t, y, rates, scene, held, w):
    """Modal accelerations without modal forces to w.speed.acceleration, for hinges and wheels at `rates` (nu,).

    `held` and w are those of `held_hinges`. Returns a status code.
    """
    load_state(t, y, scene, w)
    for j in range(rates.shape[0]):
        w.function[scene.function.shape[0] + j, 2] = rates[j]
    return forward_dynamics(held, w)


def held_hinges(c: Constants, w: Workspace) -> tuple[Constants, Workspace]:
    """The constants c with every hinge and wheel prescribed, and a copy of w with a function for each of them."""
    speeds, functions = len(c.speed), len(c.function)
    speed = c.speed.copy()
    speed["prescribed"] = functions + np.arange(speeds)
    for body in c.body:
        speed["prescribed"][body["etad_index"] : body["etad_index"] + body["modes"]] = -1
    function = np.concatenate([c.function, np.zeros(speeds, FUNCTION)])
    return replace(c, speed=speed, function=function), replace(w, function=np.zeros((len(function), 3)))
