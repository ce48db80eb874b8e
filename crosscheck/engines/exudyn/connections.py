"""Loads of connectors in an Exudyn run, from the recorded motion of their ends and joints."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from crosscheck.engines.connections import Along, Exerted, Moving, along_hinges, exerts
from crosscheck.engines.conventions import frame
from crosscheck.engines.exudyn.assembly import Assembly
from crosscheck.engines.exudyn.balance import coordinate, coordinate_rate
from crosscheck.engines.exudyn.markers import marker_path
from crosscheck.engines.exudyn.state import CarrierPath, States
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.ends import EndFrame, ends
from flexmb.scene.tree import GROUND
from flexmb.typing import Real

Paths = dict[int, CarrierPath]


class Connected(NamedTuple):
    """By name, at T samples: wrenches (T,6) of connectors between nodes on B about B, loads (T,1) of those along
    hinges; energy (T,) stored in all."""

    between: dict[str, Real]
    along: dict[str, Real]
    energy: Real


def connected(assembly: Assembly, states: States, paths: Paths) -> Connected:
    between, along = _between(assembly, states, paths), _along(assembly, states.times.tolist(), paths)
    energy = np.zeros(len(states.times))
    for each in between.values():
        energy += [at.energy for at in each]
    for held in along.values():
        energy += [at.energy for at in held]
    return Connected(
        {name: np.array([at.on_b for at in each]) for name, each in between.items()},
        {name: np.array([[at.load] for at in held]) for name, held in along.items()},
        energy,
    )


def _between(assembly: Assembly, states: States, paths: Paths) -> dict[str, list[Exerted]]:
    found = {}
    for connector in assembly.scene.connectors:
        if isinstance(connector, BetweenNodes):
            a, b = (_moving(assembly, end, paths, len(states.times)) for end in ends(connector))
            law = exerts(connector)
            found[connector.name] = [law(t, *ends) for t, *ends in zip(states.times.tolist(), a, b, strict=True)]
    return found


def _along(assembly: Assembly, times: list[float], paths: Paths) -> dict[str, list[Along]]:
    found = {}
    for name, item, number, load in along_hinges(assembly.scene):
        stage = assembly.links[item].stages[number]
        motion = zip(times, coordinate(stage, paths).tolist(), coordinate_rate(stage, paths).tolist(), strict=True)
        found[name] = [load(*each) for each in motion]
    return found


def _moving(assembly: Assembly, end: EndFrame, paths: Paths, count: int) -> list[Moving]:
    own = frame(end.position_m, end.quaternion)
    if end.body == GROUND:
        return [Moving(own.position, own.rotation, np.zeros(3), np.zeros(3))] * count
    placed = assembly.bodies[end.body].at(end.node)
    path = marker_path(paths[placed.carrier.key], placed.shape(end.node), own.position)
    turns: Real = Rotation.from_quat(path.quaternion, scalar_first=True).as_matrix() @ own.rotation
    motion = zip(path.position, turns, path.velocity[:, :3], path.velocity[:, 3:], strict=True)
    return [Moving(*each) for each in motion]
