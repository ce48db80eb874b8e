"""A mapping held against the variables of an FMU: from where every column of the scene comes, and what is set."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from crosscheck.engines.fmu.archive import FmuArchive, FmuVariable
from crosscheck.engines.fmu.bad import BadFmu
from crosscheck.engines.fmu.columns import ColumnGroup, StateColumn, groups, states
from crosscheck.engines.fmu.mapping import MappingFile, Read, Set
from crosscheck.engines.fmu.units import Unit, unit
from flexmb.scene.keys import split_unit
from flexmb.scene.problems import closest
from flexmb.scene.schema import Scene
from flexmb.scene.values import PathError, values_at


class Source(NamedTuple):
    """Where a column comes from: factor * (a variable) + offset in SI, or the offset alone if there is no variable."""

    variable: FmuVariable | None
    factor: float
    offset: float


class Setting(NamedTuple):
    """A variable that is set before a run to factor * (the number of the scene at `path`) + offset, in its own unit;
    to the offset if there is no path."""

    variable: FmuVariable
    path: str
    factor: float
    offset: float

    def value(self, scene: Scene) -> float:
        """What the variable is set to; PathError where the scene has no such number."""
        return self.offset + (self.factor * _number(scene, self.path) if self.path else 0.0)


class MappedColumns(NamedTuple):
    """What is read and set: `columns` by their names in the scene; `given`: the groups of which all columns are there,
    with the columns that they are made of."""

    columns: dict[str, Source]
    settings: tuple[Setting, ...]
    given: tuple[tuple[ColumnGroup, tuple[str, ...]], ...]
    coordinates: bool

    @property
    def variables(self) -> tuple[FmuVariable, ...]:
        """All variables that are read, each once."""
        read = (source.variable for source in self.columns.values())
        return tuple(dict.fromkeys(each for each in read if each is not None))

    @property
    def paths(self) -> tuple[str, ...]:
        """Numbers of the scene that are set."""
        return tuple(setting.path for setting in self.settings if setting.path)


def of_mapping(archive: FmuArchive, mapping: MappingFile, scene: Scene, where: str) -> MappedColumns:
    """The layout that a mapping file `where` states for the scene. BadFmu for what does not fit, by name."""
    every, moving = list(groups(scene)), states(scene)
    si = {name: text for group in every for name, text in (*group.columns, *group.instead)}
    si |= {name: state.unit for name, state in moving.items()}
    twice = {name for group in every for name, _ in (*group.columns, *group.instead)} & moving.keys()
    for name in mapping.channels:
        if name not in si:
            raise BadFmu(f'{where}: scene "{scene.name}" has no column "{name}": {closest(name, si)}')
        if name in twice:
            raise BadFmu(f'{where}: scene "{scene.name}" has a hinge and a marker with "{name}": rename one of them')
    columns = {
        name: _source(archive, entry, unit(si[name]), f'{where}, channel "{name}"')
        for name, entry in mapping.channels.items()
    }
    settings = tuple(
        _setting(archive, name, entry, scene, f'{where}, parameter "{name}"')
        for name, entry in mapping.parameters.items()
    )
    _require_inputs(archive, {setting.variable.name for setting in settings}, where)
    coordinates = any(name in columns for name in moving)
    if coordinates:
        _require_coordinates(scene, columns, moving, where)
    given = tuple(_given(every, columns, where))
    if not given and not (coordinates and scene.markers):
        raise BadFmu(f"{where} maps no channel that is compared: map coordinates, markers, loads, drives or energies")
    return MappedColumns(columns, settings, given, coordinates)


def of_own(archive: FmuArchive, scene: Scene) -> MappedColumns:
    """The layout of an FMU that flexmb has exported: names and units are those of the scene."""
    every, moving = list(groups(scene)), states(scene)
    there = set(archive.names)
    names = [name for group in every for name, _ in (*group.columns, *group.instead) if name in there]
    columns = {name: Source(archive.variable(name), 1.0, 0.0) for name in names}
    settings = [Setting(archive.variable(name), path, 1.0, 0.0) for name, path in own_parameters(archive).items()]
    starts = [
        Setting(archive.variable(name), "", 0.0, state.start)
        for name, state in moving.items()
        if name in there and not state.prescribed
    ]
    given = tuple(_given(every, columns, str(archive.path)))
    return MappedColumns(columns, (*settings, *starts), given, coordinates=False)


def own_parameters(archive: FmuArchive) -> dict[str, str]:
    """The parameters of an FMU that flexmb has exported, and the paths of their numbers in the scene."""
    ending = " of the scene"
    described = ((each.name, each.description or "") for each in archive.description.modelVariables)
    return {
        name: text.removesuffix(ending)
        for name, text in described
        if name.startswith("parameters.") and text.endswith(ending)
    }


def _given(
    every: Iterable[ColumnGroup], columns: Mapping[str, Source], where: str
) -> Iterator[tuple[ColumnGroup, tuple[str, ...]]]:
    """The groups that are mapped; BadFmu for one of which columns are missing."""
    for group in every:
        names = tuple(name for name, _ in group.columns)
        if group.instead:
            as_matrix = tuple(name for name, _ in group.instead)
            of_quaternion = [name for name in names if ".quaternion." in name]
            if any(name in columns for name in as_matrix):
                if any(name in columns for name in of_quaternion):
                    raise BadFmu(f'{where} maps the rotation of "{group.name}" as a matrix and as a quaternion')
                names = (*names[:3], *as_matrix, *names[7:])
        here = [name for name in names if name in columns]
        if not here:
            continue
        if missing := [name for name in names if name not in columns]:
            raise BadFmu(
                f'{where} maps "{here[0]}" and not "{missing[0]}", which belongs to it: a '
                f"{group.kind.replace('_', ' ')} has {len(names)} columns, {', '.join(names)}; give a number where one "
                "is constant"
            )
        yield group, names


def _require_coordinates(
    scene: Scene, columns: Mapping[str, Source], moving: Mapping[str, StateColumn], where: str
) -> None:
    """BadFmu unless the mapped coordinates and speeds are all that place the bodies of the scene."""
    if deforming := [body.name for body in scene.bodies if body.level != "rigid"]:
        raise BadFmu(
            f'{where} maps coordinates, and body "{deforming[0]}" deforms: they do not place it; map markers instead'
        )
    for name, state in moving.items():
        if not state.prescribed and name not in columns:
            raise BadFmu(
                f'{where} maps coordinates and not "{name}": all of the scene are needed to find where its bodies are; '
                "map it too, or markers instead of coordinates"
            )


def _require_inputs(archive: FmuArchive, known: set[str], where: str) -> None:
    for name in archive.inputs:
        if name not in known and not any(each.startswith(f"{name}[") for each in known):
            raise BadFmu(
                f'{archive.path} needs its input "{name}", which a run leaves to nobody: name it under [parameters] in '
                f"{where} with a constant or a number of the scene; build what changes with time into the model"
            )


def _source(archive: FmuArchive, entry: float | str | Read, si: Unit, where: str) -> Source:
    if isinstance(entry, int | float):
        return Source(None, 0.0, float(entry))
    read = Read(variable=entry) if isinstance(entry, str) else entry
    variable = archive.variable(read.variable)
    own = _unit_of(variable, read.unit, si, where)
    return Source(variable, read.sign * read.scale * own.factor, read.sign * read.scale * own.offset + read.offset)


def _setting(archive: FmuArchive, name: str, entry: float | Set, scene: Scene, where: str) -> Setting:
    variable = archive.variable(name)
    if variable.fixed:
        raise BadFmu(f"{where} cannot be set: {variable.fixed}")
    if isinstance(entry, int | float):
        return Setting(variable, "", 0.0, float(entry))
    try:
        _number(scene, entry.scene)
    except PathError as error:
        raise BadFmu(f"{where}: {error}") from None
    own = _unit_of(variable, entry.unit, unit(_unit_at(entry.scene)), where)
    return Setting(
        variable, entry.scene, entry.sign * entry.scale / own.factor, (entry.offset - own.offset) / own.factor
    )


def _unit_of(variable: FmuVariable, stated: str | None, si: Unit, where: str) -> Unit:
    """The unit of a variable, as declared or stated; BadFmu where both differ or it is one of another quantity."""
    declared = variable.unit
    try:
        found = unit(stated) if stated is not None else declared
    except ValueError as error:
        raise BadFmu(f"{where}: {error}") from None
    if found is None:
        if si.dimension == "1" and si.name == "1":
            return si
        raise BadFmu(f'{where}: the FMU declares no unit of "{variable.name}": state it, such as unit = "{si.name}"')
    if not found.same_quantity(si):
        raise BadFmu(
            f'{where}: "{variable.name}" is in {found.name}, which is {found.dimension}, and {si.name} is wanted: '
            f"{si.dimension}"
        )
    if declared is not None and declared.same_quantity(si) and stated is not None:
        if abs(declared.factor - found.factor) > 1e-9 * abs(found.factor):
            raise BadFmu(f'{where}: the FMU declares "{variable.name}" in {declared.name}: leave unit = "{stated}" out')
        return declared
    if declared is not None and not declared.same_quantity(si):
        raise BadFmu(f'{where}: the FMU declares "{variable.name}" in {declared.name}, and {si.name} is wanted')
    return found


def _number(scene: Scene, path: str) -> float:
    values = values_at(scene, path)
    if len(values) != 1 or isinstance(values[0], bool) or not isinstance(values[0], int | float):
        raise PathError(f'"{path}" is not one number of the scene: name one, such as rod.mass_kg')
    return float(values[0])


def _unit_at(path: str) -> str:
    """The unit of a number of a scene, by the key that has it."""
    keys = [step for step in path.split(".") if not step.isdecimal()]
    return split_unit(keys[-1])[1] or "1"
