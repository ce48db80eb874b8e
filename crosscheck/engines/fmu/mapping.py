"""The mapping file: which variables of a foreign FMU are which channels of the scene, in which unit, with which sign.

A complete file, `pendulum.toml` beside `pendulum.fmu`::

    scene = "scene.toml"                    # the scene that the FMU models
    fmu = "pendulum.fmu"                    # left out: the file of the same name
    interface = "model exchange"            # or "co-simulation"; left out: the first of these that it offers

    [channels]                              # columns of the scene, as in a trajectory's table
    "pivot.rotation" = { variable = "phi", sign = -1 }         # a coordinate, in the unit that the FMU declares
    "pivot.rotation.rate" = { variable = "omega", sign = -1, unit = "deg/s" }
    "energy.kinetic" = "T"
    "pivot.force.z" = 0.0                   # a constant, in SI

    [parameters]                            # what is set before a run: parameters, start values, inputs
    mass = { scene = "rod.mass_kg", unit = "g" }               # a number of the scene
    phi = { scene = "pivot.rotation.angle_rad", sign = -1 }
    friction = 0.0                          # a constant, in the variable's unit
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import msgspec

from crosscheck.engines.fmu.archive import Interface
from crosscheck.engines.fmu.bad import BadFmu
from flexmb.scene.convert import to_struct
from flexmb.scene.problems import SceneError
from flexmb.scene.reading import Unreadable, parse_toml

EffortKind = Literal["steps", "tolerances"]


class _MappingEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of the entries, which refuses unknown keys."""


class Read(_MappingEntry, frozen=True, kw_only=True):
    """A column that is read from a variable: sign * scale * (the variable in SI) + offset, the offset in SI.

    unit: that of the variable, where the FMU declares none.
    """

    variable: str
    unit: str | None = None
    sign: Literal[1, -1] = 1
    scale: float = 1.0
    offset: float = 0.0


class Set(_MappingEntry, frozen=True, kw_only=True):
    """A variable that is set before a run: sign * scale * (the number of the scene) + offset, the offset in SI.

    scene: path of the number, as for `Scene.with_values`. unit: that of the variable, where the FMU declares none.
    """

    scene: str
    unit: str | None = None
    sign: Literal[1, -1] = 1
    scale: float = 1.0
    offset: float = 0.0


class MappingFile(_MappingEntry, frozen=True, kw_only=True):
    """The whole file.

    scene: the file of the scene that the FMU models, relative to this file. fmu: the FMU, likewise; by default the
    file of the same name. interface: how it is run; by default Model Exchange if it offers that. efforts: of
    Co-Simulation, communication steps, or tolerances of the model's own integrator. step: a parameter of the FMU that
    is set to the communication step, such as its own fixed step. channels, by column of the scene: a variable's name,
    a number in SI, or how it is read. parameters, by variable: a number in the variable's unit, or a number of the
    scene.
    """

    scene: str | None = None
    fmu: str | None = None
    interface: Interface | None = None
    efforts: EffortKind = "steps"
    step: str | None = None
    channels: dict[str, float | str | Read] = {}
    parameters: dict[str, float | Set] = {}


def read_mapping(path: Path) -> MappingFile:
    """The content of a mapping file; BadFmu names the file, each place in it that is wrong, and the remedy."""
    try:
        return to_struct(parse_toml(path.read_text(encoding="utf-8")), MappingFile, str(path))
    except SceneError as error:  # its message would call the file a scene
        raise BadFmu(f"{path} is no mapping of an FMU: {'; '.join(map(str, error.problems))}") from None
    except (Unreadable, OSError, UnicodeDecodeError, RecursionError, OverflowError) as error:
        raise BadFmu(f"{path} is no mapping of an FMU: {error}") from None
