"""What cannot be exported, by name with the remedy, before anything is compiled."""

from __future__ import annotations

import os
import platform
import shutil
import sys

from flexmb.scene.connectors import sticks
from flexmb.scene.schema import Scene
from flexmb.system.system import System

INPUT_KEYS = ("function", "torque_Nm", "force_N")
"""Keys of the functions of time that may be inputs: of loads, and of motors and actuators."""

MOST_SPEEDS = 300
"""Of a scene whose derivatives are exported: an instance holds some 100 bytes for each pair of them."""


class NotExportable(NotImplementedError):
    """A scene, or a machine, of which no program can be made; the message says what is in the way, and the remedy."""


def refuse(scene: Scene) -> None:
    """NotExportable for a scene that is more than one differential equation, with the constraints that it keeps."""
    name = f'scene "{scene.name}"'
    if scene.controllers:
        raise NotExportable(
            f'{name} cannot be exported: controller "{scene.controllers[0].name}" runs beside the equations of motion: '
            "take the controllers out, make what they drive an input (--input HINGE.rotation.torque_Nm), and close the "
            "feedback where the model is imported"
        )
    if scene.events:
        raise NotExportable(
            f'{name} cannot be exported: event "{scene.events[0].name}" changes the scene in a run: take the events '
            "out, or export the scene of each stage by itself"
        )
    for connector in filter(sticks, scene.connectors):
        raise NotExportable(
            f'{name} cannot be exported: friction "{connector.name}" sticks (its smoothing is 0), which is decided by '
            "events in a run: give it a smoothing speed"
        )
    if scene.total_loads:
        raise NotExportable(
            f'{name} cannot be exported: the total load "{scene.total_loads[0].name}" is a sum that no compiled code '
            "makes yet: take it out, and add the loads of its joints where the model is imported"
        )
    if not scene.bodies or not (scene.hinges or scene.wheels or scene.point_masses):
        raise NotExportable(f"{name} cannot be exported: it has nothing that moves; add a hinge")


def refuse_derivatives(system: System) -> None:
    """NotExportable for a scene that can be exported, but without derivatives."""
    if system.nu > MOST_SPEEDS:
        raise NotExportable(
            f'scene "{system.scene.name}" has {system.nu} speeds, and derivatives by all of them are dense: they are '
            f"exported of at most {MOST_SPEEDS}; leave the derivatives out"
        )
    try:
        if system.constraints is not None:
            system.constraints.require_rows("an export of derivatives")
    except NotImplementedError as error:
        raise NotExportable(f"{error}, or leave the derivatives out") from None


def c_compiler() -> str:
    """The C compiler, of the variable CC or else cc, gcc or clang; NotExportable where there is none."""
    if sys.platform != "linux" or platform.machine() not in ("x86_64", "AMD64"):
        raise NotExportable(
            f"export is for Linux on x86-64 yet, not for {sys.platform} on {platform.machine()}: run it on such a "
            "machine or in a container"
        )
    for name in filter(None, (os.environ.get("CC"), "cc", "gcc", "clang")):
        if found := shutil.which(name):
            return found
    raise NotExportable(
        "an FMU needs a C compiler with its linker, and none of cc, gcc and clang is on the path: install one "
        "(apt-get install gcc, dnf install gcc), or name it in the variable CC"
    )
