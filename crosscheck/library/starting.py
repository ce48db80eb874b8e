"""Whether a robot moves from its start, and a start for one that would rest: what never changes tells nothing."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import numpy as np
from msgspec.structs import replace

from flexmb.scene.hinges import Free, Hinge, Spherical, Weld
from flexmb.scene.problems import SceneWarning
from flexmb.scene.schema import Scene
from flexmb.scene.tree import coordinates, with_coordinates

RATE = 0.5
"""rad/s or m/s, of every coordinate."""
SPIN = (0.3, -0.4, 0.25)
"""rad/s, of what turns about all axes: about none of symmetry."""
STILL = 1e-9
"""Accelerations (rad/s², m/s²) up to which a scene rests; those of gravity are ten."""
Place = tuple[str, str]
"""The names of a hinge and of one of its scalar coordinates."""


def is_welded(scene: Scene) -> bool:
    """Whether no hinge moves."""
    return all(isinstance(hinge, Weld) for hinge in scene.hinges)


def moves(scene: Scene) -> bool:
    """Whether anything moves, or is accelerated, at the start."""
    from flexmb.system.compile import compile as compiled  # loads the compiler

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)  # of which the runs tell
        system = compiled(scene)
    state = system.initial_state
    return bool(np.any(np.abs([*state.u, *system.accelerations(state)]) > STILL))


def started(scene: Scene) -> Scene:
    """The scene with rates of all hinges, in the proportions of its couplings."""
    rates = _rates(scene)
    return replace(scene, hinges=tuple(_with_rates(hinge, rates) for hinge in scene.hinges))


def _rates(scene: Scene) -> dict[Place, float]:
    only = {hinge.name: next((name for name, _ in coordinates(hinge)), "") for hinge in scene.hinges}
    led = {(each.hinge, each.coordinate or only[each.hinge]) for each in scene.couplings}
    places = [(hinge.name, name) for hinge in scene.hinges for name, _ in coordinates(hinge)]
    rates = {place: RATE for place in places if place not in led}
    for _ in scene.couplings:  # what leads may be led itself
        for each in scene.couplings:
            leading = {(term.hinge, term.coordinate or only[term.hinge]): term.ratio for term in each.terms}
            if leading.keys() <= rates.keys():
                place = each.hinge, each.coordinate or only[each.hinge]
                rates[place] = sum(ratio * rates[leader] for leader, ratio in leading.items())
    return rates


def _with_rates(hinge: Hinge, rates: Mapping[Place, float]) -> Hinge:
    if isinstance(hinge, Free | Spherical):
        return replace(hinge, angular_velocity_rad_s=SPIN)
    return with_coordinates(
        hinge,
        (replace(each, **{each.KEYS.rate: rates.get((hinge.name, name), 0.0)}) for name, each in coordinates(hinge)),
    )
