"""Names and units of what a linear model is made of; they do not depend on the state."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.system.system import System
from flexmb.tables.arrays import Constants
from flexmb.typing import Index

Name = tuple[str, str]
"""With the unit."""
_ROTATION = tuple((f"rotation.{axis}", "rad") for axis in "xyz")
_POSITION = tuple((f"position.{axis}", "m") for axis in "xyz")
_OF_MARKERS = (*zip("xyz", "mmm", strict=True), *_ROTATION)
_FORCE = {"rad/s": "N m", "m/s": "N", "1/s": "1"}


class ModelLabels(NamedTuple):
    """displacements, speeds: of the n free speeds. driven: indices among these of those that a motor can drive, all but
    the modal ones; inputs: of the loads along these. markers: of displacement and rotation of every marker."""

    displacements: tuple[Name, ...]
    speeds: tuple[Name, ...]
    driven: Index
    inputs: tuple[Name, ...]
    markers: tuple[Name, ...]


def model_labels(system: System, constants: Constants, free: Index) -> ModelLabels:
    """Of a system whose speeds `free` (n,) are free with these constants."""
    places, is_modal = free.tolist(), np.zeros(system.nu, bool)
    for body in constants.body:
        is_modal[int(body["etad_index"]) : int(body["etad_index"] + body["modes"])] = True
    every = _displacements(system, constants)
    displacements, speeds = (tuple(names[j] for j in places) for names in (every, system.state_names[1]))
    driven = np.flatnonzero(~is_modal[free])
    inputs = tuple((displacements[i][0], _FORCE[speeds[i][1]]) for i in driven)
    markers = ((f"{marker.name}.{label}", unit) for marker in system.scene.markers for label, unit in _OF_MARKERS)
    return ModelLabels(displacements, speeds, driven, inputs, tuple(markers))


def _displacements(system: System, constants: Constants) -> list[Name]:
    """Along all speeds: those of the coordinates, "<hinge>.rotation.x" and "<hinge>.position.x" of quaternions."""
    named = [("", "")] * system.nu
    coordinates = system.state_names[0]
    for j, speed in enumerate(constants.speed):
        if speed["coordinate"] >= 0:
            named[j] = coordinates[speed["coordinate"]]
    for name, body in zip(system.body_names, constants.body, strict=True):
        modes = slice(int(body["etad_index"]), int(body["etad_index"] + body["modes"]))
        named[modes] = coordinates[int(body["eta_index"]) : int(body["eta_index"] + body["modes"])]
        if body["quaternion"] >= 0:
            hinge = next(hinge.name for hinge in system.scene.hinges if hinge.child == name)
            labels = _ROTATION if body["quaternion"] == body["q_index"] else _ROTATION + _POSITION
            j = int(body["u_index"])
            named[j : j + len(labels)] = [(f"{hinge}.{label}", unit) for label, unit in labels]
    return named
