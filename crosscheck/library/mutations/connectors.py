"""Mutations of connectors: of the laws of springs, dampers and friction, and of their points of attachment."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from msgspec.structs import replace

from crosscheck.library.case import CaseError
from crosscheck.library.mutations.edits import conjugated, multiplied, of_connector
from crosscheck.library.mutations.mutation import DROPPED, FACTOR, Mutation, MutationTarget, SceneChange
from flexmb.scene.connectors import Bushing, Connector, Matrix6, SpringDamper, by_stem, sticks
from flexmb.scene.keys import split_unit
from flexmb.scene.schema import Scene

STIFF, LOSING = ("stiffness", "stiffening", "loads"), ("damping", "sliding", "static", "stop_dissipation")
DAMPING, REST, PRELOAD = ("damping", "stop_dissipation"), ("free_length", "rest"), ("preload",)
STOPS, STOP_STIFFNESS = ("lower", "upper"), ("stop_stiffness",)
FRICTION, CREEP = ("sliding", "static"), ("smoothing", "stribeck")
PLACES = ("position_a", "position_b")


def connectors(scene: Scene) -> Iterator[MutationTarget]:
    """All connectors; those that only pull or only push are separate kinds."""
    for connector in scene.connectors:
        acts = getattr(connector, "acts", "both")
        kind = str(connector.__struct_config__.tag)
        yield MutationTarget(connector.name, kind if acts == "both" else f"{kind} in {acts}")


def _scaled(stems: tuple[str, ...], factor: float) -> SceneChange:
    """The numbers of a connector under keys with these stems, times a factor."""

    def changed(connector: Connector) -> Connector:
        keys = [key for key in connector.__struct_fields__ if split_unit(key)[0] in stems]
        return multiplied(connector, keys, factor)

    return of_connector(changed)


@of_connector
def _without_losses(connector: Connector) -> Connector:
    """Friction that sticks needs some: without any it is written as smooth friction of zero."""
    keys = {split_unit(key)[0]: key for key in connector.__struct_fields__}
    without = multiplied(connector, [keys[stem] for stem in LOSING if stem in keys], DROPPED)
    if not sticks(connector):
        return without
    return replace(without, **{keys["static"]: None, keys["stribeck"]: None, keys["smoothing"]: 1.0})


@of_connector
def _both_ways(connector: Connector) -> Connector:
    if not isinstance(connector, SpringDamper):
        raise CaseError(f'connector "{connector.name}" acts both ways')
    return replace(connector, acts="both")


def _of_bushing(change: Callable[[Bushing], Bushing]) -> SceneChange:
    def changed(connector: Connector) -> Connector:
        if not isinstance(connector, Bushing):
            raise CaseError(f'connector "{connector.name}" has no frames: a bushing has')
        return change(connector)

    return of_connector(changed)


def _transposed(bushing: Bushing) -> Bushing:
    return conjugated(bushing, "quaternion_a", "quaternion_b")


def _ends_exchanged(bushing: Bushing) -> Bushing:
    """A is where B was. The rotation vector is the opposite one, and so is the displacement, in axes of the other."""
    at = {key: getattr(bushing, key) for key in bushing.__struct_fields__}
    other = {"a": "b", "b": "a"}
    keys = ("body_{}", "node_{}", "position_{}_m", "quaternion_{}")
    return replace(bushing, **{key.format(end): at[key.format(other[end])] for key in keys for end in other})


def _linear_first(bushing: Bushing) -> Bushing:
    def exchanged(matrix: Matrix6) -> Any:
        order = (3, 4, 5, 0, 1, 2)
        return tuple(tuple(matrix[i][j] for j in order) for i in order)

    return replace(bushing, stiffness=exchanged(bushing.stiffness), damping=exchanged(bushing.damping))


def _never_pressed(scene: Scene, target: str) -> str:
    """A stop without stiffness stops nothing."""
    connector = next(connector for connector in scene.connectors if connector.name == target)
    return "" if by_stem(connector).get("stop_stiffness") else "its stops have no stiffness"


MUTATIONS = (
    Mutation(
        "connector_stiffness", "+1 % stiffness of a connector", "a wrong figure", connectors, _scaled(STIFF, FACTOR)
    ),
    Mutation(
        "connector_damping", "+1 % damping of a connector", "a wrong figure", connectors, _scaled(DAMPING, FACTOR)
    ),
    Mutation(
        "connector_rest",
        "+1 % free length of a spring, or place of rest; of a buffer the gap",
        "a wrong figure",
        connectors,
        _scaled(REST, FACTOR),
    ),
    Mutation("connector_preload", "no preload", "the load at rest left out", connectors, _scaled(PRELOAD, DROPPED)),
    Mutation(
        "connector_losses",
        "no damping or friction of a connector",
        "dissipation left out",
        connectors,
        _without_losses,
    ),
    Mutation(
        "connector_one_sided",
        "a cable or buffer that pulls and pushes",
        "a spring on both sides for one that goes slack",
        connectors,
        _both_ways,
    ),
    Mutation(
        "connector_stop", "stops 1 % farther out", "a wrong figure", connectors, _scaled(STOPS, FACTOR), _never_pressed
    ),
    Mutation(
        "stop_stiffness", "+1 % stiffness of stops", "a wrong figure", connectors, _scaled(STOP_STIFFNESS, FACTOR)
    ),
    Mutation("friction_torque", "+1 % dry friction", "a wrong figure", connectors, _scaled(FRICTION, FACTOR)),
    Mutation(
        "friction_speed",
        "+1 % of the speeds at which dry friction is smoothed and falls",
        "a wrong figure, or another law near rest",
        connectors,
        _scaled(CREEP, FACTOR),
    ),
    Mutation(
        "connector_position",
        "+1 % offsets of a connector from its nodes",
        "a wrong figure, or another point of attachment",
        connectors,
        _scaled(PLACES, FACTOR),
    ),
    Mutation(
        "bushing_rotation",
        "transposed rotations between a bushing's frames and its nodes",
        "a matrix from A to B taken for that from B to A",
        connectors,
        _of_bushing(_transposed),
    ),
    Mutation(
        "bushing_ends",
        "frames A and B of a bushing exchanged",
        "displacement in axes of the one body for that in axes of the other",
        connectors,
        _of_bushing(_ends_exchanged),
    ),
    Mutation(
        "bushing_order",
        "translation before rotation in a bushing's matrices",
        "another order of spatial vectors",
        connectors,
        _of_bushing(_linear_first),
    ),
)
