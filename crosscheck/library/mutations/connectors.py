"""Mutations of connectors: their stiffness, where they are at rest, and what they lose."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import msgspec

from crosscheck.library.mutations.edits import replaced, scaled
from crosscheck.library.mutations.mutation import FACTOR, Mutation, MutationTarget
from flexmb.scene.connectors import Connector
from flexmb.scene.schema import Scene
from flexmb.scene.units import split_unit

STIFF, LOSING = ("stiffness", "stiffening", "loads"), ("damping", "sliding", "static", "stop_dissipation")
REST = ("free_length", "rest")


def connectors(scene: Scene) -> Iterator[MutationTarget]:
    """All of them."""
    yield from (MutationTarget(each.name, str(each.__struct_config__.tag)) for each in scene.connectors)


def _scaled(stems: tuple[str, ...], factor: float) -> Callable[[Scene, str], Scene]:
    """The numbers of a connector under keys that begin so, times a factor."""

    def times(value: Any) -> Any:
        if value is None:
            return None
        return scaled(value, factor) if isinstance(value, tuple) else factor * value

    def changed(connector: Connector) -> Connector:
        keys = [key for key in connector.__struct_fields__ if split_unit(key)[0] in stems]
        return msgspec.structs.replace(connector, **{key: times(getattr(connector, key)) for key in keys})

    return lambda scene, target: msgspec.structs.replace(
        scene, connectors=replaced(scene.connectors, target, changed)
    )


MUTATIONS = (
    Mutation(
        "connector_stiffness", "+1 % stiffness of a connector", "a wrong figure", connectors, _scaled(STIFF, FACTOR)
    ),
    Mutation(
        "connector_rest",
        "+1 % free length of a spring, or place of rest",
        "a wrong figure",
        connectors,
        _scaled(REST, FACTOR),
    ),
    Mutation(
        "connector_losses",
        "no damping or friction of a connector",
        "dissipation left out",
        connectors,
        _scaled(LOSING, 0.0),
    ),
)
