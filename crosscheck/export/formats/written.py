"""What a format makes of a scene: a text, or why it has none; and what of the scene the text does not say."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, assert_never

from crosscheck.engines.links import Ball, Floating, Link, Scalar, links, obstacle
from flexmb.scene.connectors import AngularFriction, AngularSpring, Bushing, LinearFriction, LinearSpring, SpringDamper
from flexmb.scene.freedoms import Coordinate, ScalarFreedom
from flexmb.scene.schema import Scene

_CONNECTORS = (SpringDamper, Bushing, AngularSpring, LinearSpring, AngularFriction, LinearFriction)
"""No format here holds any; they are listed among what is left out."""


@dataclass(frozen=True)
class Written:
    """`text` is "" where the format cannot hold the mechanism, and `refused` says why; `left_out` lists what of the
    scene is not in the text and has to be added by whoever uses it."""

    text: str = ""
    refused: str = ""
    left_out: tuple[str, ...] = ()


def chain_of(scene: Scene, program: str, screws: bool = False) -> tuple[tuple[Link, ...], str]:
    """The links of a rigid tree, or why a format of rigid trees cannot hold the scene."""
    why = obstacle(scene, program, (), _CONNECTORS, screws)
    return ((), why) if why else (links(scene), "")


def beside_the_tree(scene: Scene) -> tuple[str, ...]:
    """What acts on a tree and no format here holds: connectors, loads, motors, prescribed motions, feedback, events."""
    names = [f"{kind} {item.name}" for kind, items in _parts(scene) for item in items]
    names += [f"motor of {name}" for name, coordinate in _scalars(scene) if coordinate.effort is not None]
    return (*names, *prescribed(scene))


def prescribed(scene: Scene) -> tuple[str, ...]:
    """Coordinates that follow a function of time, which are free in a format that has none."""
    return tuple(
        f"prescribed motion of {name}: the joint is free here"
        for name, coordinate in _scalars(scene)
        if coordinate.prescribed is not None
    )


def _scalars(scene: Scene) -> list[tuple[str, Coordinate]]:
    """Scalar coordinates with the names of their hinges, wheels and point masses."""
    moved = [*scene.hinges, *scene.wheels, *scene.point_masses]
    return [(hinge.name, f.coordinate) for hinge in moved for f in hinge.freedoms if isinstance(f, ScalarFreedom)]


def springs(chain: tuple[Link, ...]) -> tuple[str, ...]:
    """Joints with a spring or a damper of their own."""
    lines = []
    for link in chain:
        for freedom in link.freedoms:
            match freedom:
                case Scalar(stiffness=stiffness, damping=damping) | Ball(stiffness=stiffness, damping=damping):
                    lines += [f"spring or damper of {link.joint}"] * bool(stiffness or damping)
                case Floating():
                    pass
                case _:
                    assert_never(freedom)
    return tuple(dict.fromkeys(lines))


def _parts(scene: Scene) -> tuple[tuple[str, tuple[Any, ...]], ...]:
    return (
        ("connector", scene.connectors),
        ("load", scene.loads),
        ("total load", scene.total_loads),
        ("controller", scene.controllers),
        ("event", scene.events),
    )


def number(value: float) -> str:
    """A number with all its digits; minus zero is zero."""
    return repr(float(value) + 0.0)


def vector(values: Iterable[float]) -> str:
    """Numbers with all their digits, in a row."""
    return " ".join(number(value) for value in values)
