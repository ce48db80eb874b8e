"""Eigenfrequencies of an Exudyn system about an equilibrium, in the motions that its constraints allow.

With M v' = f(q, v) - C(q)' mu and C v = 0, the motion about a state of rest is

    Z'M Z s'' + Z'D Z s' + Z'K Z s = 0,    K = -d(f - C'mu)/dq,    D = -df/dv,    q = Z s to first order,

where Z spans the null space of C. The multipliers mu are held, so that K contains what the loads of joints do as they
turn with the bodies: a hanging pendulum has no other stiffness. (Exudyn's own eigenvalue solver leaves that part out.)
K and D are differences of fourth order of Exudyn's residual and of its constraints' Jacobian.

In motion, or where accelerations are left, there is no such linear model in redundant coordinates: no frequencies.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import null_space

from crosscheck.engines.exudyn.assembly import Assembly
from crosscheck.engines.exudyn.library import ExudynEquations, accelerations, equations
from crosscheck.engines.exudyn.state import States, set_state
from crosscheck.engines.linear.frequencies import eigenfrequencies
from crosscheck.engines.linear.matrices import EPS, Errors, LinearMatrices, differentiated, norm
from crosscheck.engines.linear.outputs import NOTHING, LinearOutputs
from crosscheck.engines.linear.parts import FREQUENCIES
from flexmb.typing import Real

AT_REST = 1e-6
"""Largest speed and acceleration (SI) of a state that counts as an equilibrium: the solvers leave so much."""
RANK = 1e-9  # singular values of C, relative to the largest, that count as zero: of redundant constraints


def frequencies(assembly: Assembly, states: States) -> LinearOutputs:
    """The frequencies (T,n) at all samples, and how well they are known; nothing unless all are equilibria."""
    with equations(assembly.shop.mbs) as system:
        samples = [_at(assembly, system, states, sample) for sample in range(len(states.times))]
    known = [frequency for frequency in samples if frequency is not None]
    if len(known) < len(samples) or not len(known[0].by_speed):
        return NOTHING
    rows, doubts = map(np.array, zip(*map(eigenfrequencies, known), strict=True))
    return LinearOutputs({}, rows, {FREQUENCIES: doubts})


def _at(assembly: Assembly, system: ExudynEquations, states: States, sample: int) -> LinearMatrices | None:
    """The matrices of the motions Z that are allowed; None unless the state is an equilibrium."""
    set_state(assembly.shop.mbs, states, sample)
    if system.k:
        assembly.shop.mbs.systemData.SetAECoordinates(np.zeros(system.k))
    q, v = states.q[sample], states.v[sample]
    M, f, C = system.mass(), system.force(q, v), system.jacobian(q)
    a, multipliers = accelerations(M, f, C, np.zeros(system.k))
    left = float(np.abs(np.concatenate([a, v])).max(initial=0.0))
    if left > AT_REST:
        return None

    def residual(change: Real) -> Real:
        return system.force(q + change, v) - system.jacobian(q + change).T @ multipliers

    return _reduced(M, C, residual, lambda change: system.force(q, v + change), f, left)


def _reduced(
    M: Real, C: Real, residual: Callable[[Real], Real], force: Callable[[Real], Real], f: Real, left: float
) -> LinearMatrices:
    """The matrices of the allowed motions s; `left` are the speeds and accelerations that an equilibrium lacks."""
    Z = null_space(C, rcond=RANK) if len(C) else np.eye(len(M))
    noise = len(f) * EPS * (norm(f) + norm(C))
    by_q, apart = differentiated(lambda s: Z.T @ residual(Z @ s), Z.shape[1], noise)
    by_v, asunder = differentiated(lambda s: Z.T @ force(Z @ s), Z.shape[1], noise)
    inverse = np.linalg.inv(Z.T @ M @ Z)
    inverse = (inverse + inverse.T) / 2.0
    share = float(np.linalg.norm(inverse, 2))
    errors = Errors(share * (apart + left * norm(M)), share * (asunder + left * norm(M)), EPS * norm(inverse))
    none = np.zeros_like(inverse)
    return LinearMatrices(inverse @ by_q, inverse @ by_v, inverse, none, errors)
