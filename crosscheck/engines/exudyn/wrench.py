"""Physical loads from Exudyn's connectors.

Exudyn's `TorqueLocal` holds raw multipliers, permuted and of mixed sign, never a torque. The wrench is recovered from
the generalised forces that the connectors exert on the outboard body's coordinates, through the marker's Jacobians.
"""

from __future__ import annotations

import numpy as np

from crosscheck.engines.exudyn.assembly import Assembly
from crosscheck.engines.exudyn.joints import ExudynLink, Stage
from crosscheck.engines.exudyn.state import CarrierPath, States, set_state
from flexmb.typing import Real


def link_wrenches(assembly: Assembly, states: States, paths: dict[int, CarrierPath]) -> dict[str, Real]:
    """(T,6) [torque; force] of every link on its outboard body about the hinge point, in World axes."""
    mbs, links = assembly.shop.mbs, assembly.links
    loads = {name: np.zeros((len(states.times), 6)) for name in links}
    acting = {name: link for name, link in links.items() if link.connectors}
    if acting:
        for k in range(len(states.times)):
            set_state(mbs, states, k)
            for name, link in acting.items():
                loads[name][k] = _connector_wrench(assembly, link)
    for name, link in links.items():
        if link.stages and link.stages[-1].motor is not None:
            loads[name] += _motor_wrench(link.stages[-1], states, paths)
    return loads


def drives(assembly: Assembly, states: States) -> dict[str, Real]:
    """(T,n) generalised load of every prescribed coordinate, by hinge, wheel or point mass."""
    data = assembly.shop.mbs.systemData
    loads = {}
    for name, link in assembly.links.items():
        rows = [data.GetObjectLTGAE(s.constraint)[0] for s in link.stages if s.constraint is not None]
        if rows:
            # Exudyn writes M a + C' multiplier = f with C = + d(coordinate)/dq: the load is minus the multiplier
            loads[name] = -states.multipliers[:, rows]
    return loads


def _connector_wrench(assembly: Assembly, link: ExudynLink) -> Real:
    """[torque; force] at the link's outboard marker: least-squares solution of J' [force; torque] = -C' multiplier."""
    mbs, kinds = assembly.shop.mbs, assembly.shop.exu.ComputeItemType
    J = np.vstack(
        [mbs.ComputeItem(link.marker, kinds.PositionJacobian), mbs.ComputeItem(link.marker, kinds.RotationJacobian)]
    )
    size = J.shape[1]
    left_side = np.zeros(size)
    for item, constraint in link.connectors:
        kind = kinds.ReactionForces if constraint else kinds.ODE2LHS
        left_side += np.asarray(mbs.ComputeItem(item, kind))[-size:]
    force_torque = np.linalg.lstsq(J.T, -left_side, rcond=None)[0]
    return np.roll(force_torque, 3)


def _motor_wrench(stage: Stage, states: States, paths: dict[int, CarrierPath]) -> Real:
    """(T,6) of the motor on the outboard side."""
    values = np.array([stage.motor(t).value for t in states.times])
    along = values[:, None] * (paths[stage.outboard.key].rotation @ stage.axis)
    zero = np.zeros_like(along)
    return np.hstack([along, zero] if stage.angular else [zero, along])
