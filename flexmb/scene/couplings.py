"""Couplings of a scene: linear relations between coordinates of hinges, as gears, belts and racks make them."""

from __future__ import annotations

from typing import Annotated

from flexmb.scene.bodies import SceneStruct
from flexmb.scene.quantities import Number, unit, within

Ratio = Annotated[float, within(excluded=0.0, remedy="leave this coordinate out"), unit("of q, per one of this")]

__all__ = ["CoupledCoordinate", "Coupling"]
"""What the schema exports."""


class CoupledCoordinate(SceneStruct, frozen=True, kw_only=True):
    """A coordinate that leads another one.

    `coordinate` names it as its hinge does ("rotation", "first", "rotations[1]"); it may be left out where the hinge
    has only one. `ratio` is in units of the coordinate that is led per unit of this one: a number between two angles or
    two displacements, m/rad where an angle leads a displacement, rad/m where a displacement leads an angle.
    """

    hinge: str
    coordinate: str = ""
    ratio: Ratio


class Coupling(SceneStruct, frozen=True, kw_only=True):
    """A closure of its own kind, a linear relation of hinge coordinates: q = `offset` + sum of ratio_i q_i.

    q is the coordinate of `hinge` that is led (`coordinate` as of a CoupledCoordinate), `offset` is in its unit. Angles
    count whole turns. A wheel of radius r that meshes with one of radius r_1 has the ratio -r_1 / r, with inner teeth
    or a belt r_1 / r; a rack on a pinion of radius r_1 has r_1 (m/rad); a differential has two terms. Coordinates may
    be prescribed, but not all of them.

    The coupling exerts a load f (N m or N) along q and -ratio_i f along the others, as motors of these hinges would:
    between the two bodies of each hinge. The power of all is zero. Its load is an output: f as a torque or a force on
    the child of `hinge`, along the axis of the coordinate. Initial values need to fit only roughly, as for a Closure.
    """

    name: str
    hinge: str
    coordinate: str = ""
    terms: tuple[CoupledCoordinate, ...]
    offset: Annotated[Number, unit("of the coordinate")] = 0.0
