"""Recorded states of an Exudyn system, decoded to the motion of its carriers over all samples at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.engines.exudyn.assembly import Assembly
from crosscheck.engines.exudyn.carriers import Carrier
from crosscheck.engines.exudyn.rotations import exponential, local_rate_map, matrices
from flexmb.typing import Real


@dataclass(frozen=True)
class States:
    """T samples: times (T,), coordinates, velocities and accelerations (T,n), multipliers (T,k), data coordinates."""

    times: Real
    q: Real
    v: Real
    a: Real | None
    multipliers: Real
    data: Real

    def cut(self, count: int) -> States:
        """The first `count` samples."""
        a = None if self.a is None else self.a[:count]
        return States(
            self.times[:count], self.q[:count], self.v[:count], a, self.multipliers[:count], self.data[:count]
        )


def set_state(mbs, states: States, sample: int) -> None:
    """Put one sample into the system's current configuration."""
    data = mbs.systemData
    data.SetTime(float(states.times[sample]))
    data.SetODE2Coordinates(states.q[sample])
    data.SetODE2Coordinates_t(states.v[sample])
    if states.multipliers.shape[1]:
        data.SetAECoordinates(states.multipliers[sample])
    if states.data.shape[1]:
        data.SetDataCoordinates(states.data[sample])


@dataclass(frozen=True)
class CarrierPath:
    """Motion of a carrier's Exudyn axes over T samples, in World axes; modal coordinates (T,m) where it bends.

    position, velocity, acceleration (T,3); rotation (T,3,3) to World; omega, alpha (T,3).
    """

    position: Real
    rotation: Real
    velocity: Real
    omega: Real
    acceleration: Real | None
    alpha: Real | None
    eta: Real
    eta_rate: Real
    eta_acceleration: Real | None


def carrier_path(assembly: Assembly, carrier: Carrier, states: States) -> CarrierPath:
    T = len(states.times)
    if carrier.key < 0:
        still = np.zeros((T, 3))
        eye, none = np.broadcast_to(np.eye(3), (T, 3, 3)), np.zeros((T, 0))
        return CarrierPath(still, eye, still, still, still, still, none, none, none)
    mbs = assembly.shop.mbs
    first = mbs.GetNodeODE2Index(carrier.node)
    size = 6 if assembly.shop.explicit else 7
    part = slice(first, first + size)
    reference = np.array(mbs.GetNodeParameter(carrier.node, "referenceCoordinates"))
    q, v = states.q[:, part] + reference, states.v[:, part]
    a = None if states.a is None else states.a[:, part]
    if assembly.shop.explicit:
        A = exponential(q[:, 3:])
        local, local_rate = v[:, 3:], None if a is None else a[:, 3:]
    else:
        A, G = matrices(q[:, 3:]), local_rate_map(q[:, 3:])
        local = np.einsum("tij,tj->ti", G, v[:, 3:])
        # d/dt (G pdot) = G pddot: the other term G(pdot) pdot vanishes
        local_rate = None if a is None else np.einsum("tij,tj->ti", G, a[:, 3:])
    eta = _modal(mbs, carrier, states.q, T)
    return CarrierPath(
        q[:, :3], A, v[:, :3], _turn(A, local), None if a is None else a[:, :3],
        None if local_rate is None else _turn(A, local_rate), eta, _modal(mbs, carrier, states.v, T),
        None if states.a is None else _modal(mbs, carrier, states.a, T),
    )  # fmt: skip


def _modal(mbs, carrier: Carrier, values: Real, T: int) -> Real:
    if carrier.modes is None:
        return np.zeros((T, 0))
    first = mbs.GetNodeODE2Index(carrier.modes)
    return values[:, first : first + carrier.data.shape.shape[1]]


def _turn(A: Real, local: Real) -> Real:
    """World components (T,3) of vectors in the axes A (T,3,3)."""
    return np.einsum("tij,tj->ti", A, local)
