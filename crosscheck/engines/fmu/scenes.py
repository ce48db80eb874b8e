"""Whether an FMU is a model of a scene: of the very one, or of one that differs in numbers that can be set."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import Any

import msgspec

from crosscheck.engines.fmu.archive import FmuArchive
from crosscheck.engines.fmu.layout import own_parameters
from flexmb.scene.files import dumps
from flexmb.scene.schema import Scene
from flexmb.scene.values import PathError, values_at, with_values
from flexmb.scene.without_start import without_start

WORDS = ("name", "description", "allow", "total_loads")  # of a scene, and no part of what it models


def is_own_scene(archive: FmuArchive, scene: Scene) -> bool:
    """Whether an FMU that flexmb has exported is of this very scene, but for what it does not give."""
    assert archive.own is not None
    return _digest(_seen(archive, scene)) == archive.own.scene


def own_obstacle(archive: FmuArchive, scene: Scene) -> str:
    """Why an FMU that flexmb has exported does not model a scene with other parameters and start values, "" if it
    does."""
    assert archive.own is not None
    if is_own_scene(archive, scene):
        return ""
    remedy = f"export this one: flexmb export SCENE.toml --fmu {archive.path.name}"
    try:
        exported = {path: archive.variable(name).start for name, path in own_parameters(archive).items()}
        as_exported = without_start(with_values(_seen(archive, scene), exported))
    except PathError:
        return f"{archive.path} was exported of another scene: {remedy}"
    if archive.own.model and _digest(as_exported) == archive.own.model:
        return ""
    return (
        f'{archive.path} was exported of another scene than "{scene.name}", or of this one with other levels, other '
        f"functions of time or other numbers that it has built in: {remedy}"
    )


def foreign_obstacle(modelled: Scene, scene: Scene, paths: Iterable[str]) -> str:
    """Why a model of the scene `modelled`, of which the numbers at `paths` can be set, is none of `scene`."""
    try:
        settable = {path: values_at(scene, path)[0] for path in paths}
        modelled = with_values(modelled, settable)
    except PathError as error:
        return f"the scene has not the numbers that the mapping sets: {error}"
    known = {marker.name for marker in modelled.markers}
    seen = msgspec.structs.replace(scene, markers=tuple(each for each in scene.markers if each.name in known))
    place = _difference(_plain(modelled), _plain(seen), "")
    if not place:
        return ""
    return (
        f'the FMU models scene "{modelled.name}", from which this one differs in {place}, which the mapping gives no '
        "parameter"
    )


def _seen(archive: FmuArchive, scene: Scene) -> Scene:
    """The scene without the markers that the FMU does not give, and without sums of loads, which no export has."""
    there = set(archive.names)
    given = tuple(marker for marker in scene.markers if f"{marker.name}.position.x" in there)
    return msgspec.structs.replace(scene, markers=given, total_loads=())


def _digest(scene: Scene) -> str:
    """As exported FMUs have it."""
    return hashlib.sha256(dumps(scene).encode()).hexdigest()


def _plain(scene: Scene) -> dict[str, Any]:
    plain: dict[str, Any] = msgspec.to_builtins(scene)
    return {key: value for key, value in plain.items() if key not in WORDS}


def _difference(a: Any, b: Any, place: str) -> str:
    """The first place in which two trees of plain values differ, "" if they do not."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in dict.fromkeys((*a, *b)):
            if key not in a or key not in b:
                return f"{place}.{key}".lstrip(".")
            if found := _difference(a[key], b[key], f"{place}.{key}".lstrip(".")):
                return found
        return ""
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        if len(a) != len(b):
            return f"the number of {place}"
        for i, (one, other) in enumerate(zip(a, b, strict=True)):
            name = one.get("name", i) if isinstance(one, dict) else i
            if found := _difference(one, other, f"{place}.{name}"):
                return found
        return ""
    return "" if a == b else place
