"""Checks of raw modal bodies of level stiffened: a second-order field, or the stiffness from which it follows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from flexmb.scene.bodies import ModalBody
from flexmb.scene.modal_data import ModalArrays, node_arrays
from flexmb.scene.problems import Defect, Place
from flexmb.scene.rounding import ROUNDING

FULL = 'or use level "full", which no load stiffens'


def second_order(place: Place, body: ModalBody, arrays: ModalArrays) -> Iterator[Defect]:
    """Second-order data of a body and its nodes is consistent, and at level stiffened complete."""
    for i, node in enumerate(body.nodes):
        spot = place.key("nodes", i).named(f'node "{node.name}"')
        try:
            given = node_arrays(node)
        except ValueError as error:
            yield Defect(str(spot), str(error), "give three m x m matrices, or m x m vectors")
            continue
        moves = _largest(node.translation_modes, node.rotation_modes) > ROUNDING * _largest(arrays.translation_modes)
        if "force_stiffness" in given and len(given) > 1:
            what = "second-order field and force_stiffness are given"
            yield Defect(str(spot), what, "give one of them: each follows from the other")
        elif not given and moves and body.level == "stiffened":
            remedy = f"give its second_translation (zeros, if it has none) or force_stiffness, {FULL}"
            yield Defect(str(spot), "nothing says how a load at this node stiffens the body", remedy)
    yield from _points(place, body, arrays)


def _points(place: Place, body: ModalBody, arrays: ModalArrays) -> Iterator[Defect]:
    field = [name for name in ("second_translation", "second_rotation") if name in arrays.given]
    loads = [name for name in ("gravity_stiffness", "gradient_stiffness") if name in arrays.given]
    if field and loads:
        what = f"both {field[0]} and {loads[0]} are given"
        yield Defect(str(place), what, "give one of them: the stiffness follows from the field")
    elif field == ["second_rotation"]:
        remedy = "give second_translation too (zeros, if there is none)"
        yield Defect(str(place), "second_rotation is given without second_translation", remedy)
    elif len(loads) == 1:
        what = f"of gravity_stiffness and gradient_stiffness, only {loads[0]} is given"
        yield Defect(str(place), what, "give both")
    elif body.level == "stiffened" and not field and not loads:
        what = 'level "stiffened" needs a second-order field, and the body has none'
        remedy = "give second_translation of its points, or gravity_stiffness and gradient_stiffness"
        yield Defect(str(place.key("level")), what, f"{remedy}, {FULL}")


def _largest(*shapes: ArrayLike) -> float:
    return max(float(np.max(np.abs(shape), initial=0.0)) for shape in shapes)
