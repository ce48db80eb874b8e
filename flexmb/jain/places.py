"""Order of the speeds in the mass matrix of a tree: depth first, so that a body and all it carries are contiguous.

The order of u does not have this property: it has point masses at its end, away from the bodies that carry them.
"""

from __future__ import annotations

import numpy as np

from flexmb.jit.bundle import bundle
from flexmb.scene.sizes import refuse_large_matrix
from flexmb.tables.arrays import Constants
from flexmb.typing import Index, Real


@bundle
class Matrices:
    """The mass matrix in depth-first order, and the solution of its equations.

    A *place* is a row of this matrix. Places of a body: its hinge, its modes, its wheels, then all that it carries.
    """

    hinge: Index  # (N,) first place of a body
    modes: Index  # (N,) first place of its modes
    wheels: Index  # (N,) first place of its wheels
    carried: Index  # (N,) first place of what it carries
    stop: Index  # (N,) end of what it carries
    speed: Index  # (nu,) number in u of a place
    body: Index  # (nu,) body of a place
    order: Index  # (nu,) places of the n speeds that are free, tips first, then of those that are prescribed
    X: Real  # (6,nu) forces [torque; force] of unit rates of the speeds, about the body that the sweep has reached
    M: Real  # (nu,nu) its upper triangle
    U: Real  # (n,n) upper Cholesky factor over the free speeds, tips first
    x: Real  # (n,) right-hand side, then solution
    bias: Real  # (nu,) C, in the order of u


def matrices(c: Constants) -> Matrices:
    """Places of a tree, and matrices of the right sizes. ValueError for a tree whose mass matrix would be too large."""
    bodies, nu = len(c.body), len(c.speed)
    remedy = 'take fewer bodies or modes for derivatives, or run by the algorithm "articulated", which needs none'
    refuse_large_matrix(nu, "the mass matrix", remedy)
    children: list[list[int]] = [[] for _ in range(bodies + 1)]
    for k, parent in enumerate(c.body["parent"].tolist()):
        children[parent].append(k)
    place = {name: np.zeros(bodies, np.int64) for name in ("hinge", "modes", "wheels", "carried", "stop")}
    speed: list[int] = []
    owner: list[int] = []
    waiting = [(k, False) for k in reversed(children[-1])]
    while waiting:
        k, done = waiting.pop()
        if done:
            place["stop"][k] = len(speed)
            continue
        b = c.body[k]
        wheels = c.wheel["u_index"][b["wheel_start"] : b["wheel_stop"]]
        for name, own in (
            ("hinge", range(b["u_index"], b["u_index"] + b["nv"])),
            ("modes", range(b["etad_index"], b["etad_index"] + b["modes"])),
            ("wheels", wheels.tolist()),
        ):
            place[name][k] = len(speed)
            speed += own
        place["carried"][k] = len(speed)
        owner += [k] * (len(speed) - len(owner))
        waiting.append((k, True))
        waiting += [(child, False) for child in reversed(children[k])]
    prescribed = c.speed["prescribed"][speed] >= 0
    order = sorted(range(nu), key=lambda i: (prescribed[i], -i))
    n = nu - int(np.sum(prescribed))
    return Matrices(
        **place,
        speed=np.array(speed, np.int64),
        body=np.array(owner, np.int64),
        order=np.array(order, np.int64),
        X=np.zeros((6, nu)),
        M=np.zeros((nu, nu)),
        U=np.zeros((n, n)),
        x=np.zeros(n),
        bias=np.zeros(nu),
    )
