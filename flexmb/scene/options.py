"""Keyword arguments of the builder's methods that are shared or rarely needed, as typed dictionaries.

Type checkers and editors know their names; calls refuse other names. Omitted arguments have the defaults of the schema.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal, TypedDict

from numpy.typing import ArrayLike

from flexmb.scene import schema as s
from flexmb.scene.problems import closest


def refuse_others(what: str, names: Iterable[str], known: type) -> None:
    """TypeError for a name that a typed dictionary does not declare, with the nearest name that it declares."""
    for name in names:
        if name not in known.__annotations__:
            raise TypeError(f'{what} has no "{name}": {closest(name, known.__annotations__)}')


class Placement(TypedDict, total=False):
    """Hinge frames: nodes of parent and child, and fixed offsets from them (node axes, m)."""

    parent_node: str
    child_node: str
    parent_position: ArrayLike
    parent_quaternion: ArrayLike
    child_position: ArrayLike
    child_quaternion: ArrayLike


class BeamOptions(TypedDict, total=False):
    """Model of a beam, see `flexmb.scene.schema.BeamBody`: `theory`, `mass` matrix, inertia `points`; and rigid lumps
    fixed to it, `tip_masses`."""

    theory: Literal["euler-bernoulli", "timoshenko"]
    mass: Literal["consistent", "lumped"]
    points: Literal["line", "rotary", "section"]
    tip_masses: Sequence[s.TipMass]


class Sampling(TypedDict, total=False):
    """Sampling of a controller: every `period` (s) from `offset` (s) on, with outputs that change `delay` (s) later;
    without a period the controller is continuous."""

    period: float | None
    offset: float
    delay: float


class SectionShape(TypedDict, total=False):
    """A beam section's torsion constant `J` (m⁴), `shear_factor`, and station `x` (m)."""

    J: float | None
    shear_factor: float
    x: float
