"""Numbers of a scene that an exported model can change: those on which its tables depend affinely.

Which words of the block depend on a number, and how, is found by assembling the scene with other values: two steps
tell whether the dependence is affine, a change of all numbers at once whether they act independently. Where a number
would add or remove a term of the equations, change the length of a table or a modal quantity, or act together with
another, it stays fixed, and its name is kept with the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import msgspec
import numpy as np

from flexmb.export.image import Image
from flexmb.export.refusals import INPUT_KEYS, NotExportable
from flexmb.parameters.numbers import Number
from flexmb.scene.bodies import RigidBody
from flexmb.scene.freedoms import AngularCoordinate, LinearCoordinate
from flexmb.scene.functions import Constant, Function
from flexmb.scene.keys import split_unit
from flexmb.scene.schema import Load, Scene
from flexmb.typing import Real

MOST = 256
"""Numbers that are looked at, each of which costs three assemblies of the scene, in the order of the scene."""
ROUNDING = 64.0 * 2.0**-52
TINY = 1e-300  # a word below this is a whole number, read as a float
COLLECTIONS = ("bodies", "hinges", "wheels", "point_masses", "connectors", "loads")
STEMS = {
    "mass", "axial_inertia", "transverse_inertia", "stiffness", "damping", "friction", "rest", "armature", "preload",
    "free_length", "sliding", "static", "stribeck", "smoothing", "stop_stiffness", "stop_dissipation", "lower", "upper",
}  # fmt: skip
"""Keys of parameters, without their units. Numbers of functions of time come in addition."""
FUNCTION_KEYS = {"value": "", "rate": "/s", "amplitude": "", "offset": "", "start_value": "", "end_value": ""}
"""Keys of functions of time that do not move their switches, and what their unit has beside that of the function."""


class Candidate(NamedTuple):
    """A number that may be changed: its path in the scene, its name in the model and its unit.

    is_input: whether it is the value of a load, a motor or an actuator; is_prescribed: of a prescribed motion.
    """

    path: str
    name: str
    unit: str
    is_input: bool = False
    is_prescribed: bool = False


class Effect(NamedTuple):
    """A word of the block changes by `slope` times the change of a number."""

    word: int
    slope: float


class Changeable(NamedTuple):
    """A number that the model can change, with its value in the scene and its effects."""

    candidate: Candidate
    value: float
    effects: tuple[Effect, ...]


class Numbers(NamedTuple):
    """changeable: inputs first; fixed: why the others are, by name."""

    changeable: tuple[Changeable, ...]
    fixed: dict[str, str]


def with_inputs(scene: Scene, paths: tuple[str, ...]) -> Scene:
    """The scene with zero in place of the functions of time at these paths, so that they are inputs.

    NotExportable for a path that is neither a load nor a motor or actuator, PathError for one that is not there.
    """
    for path in paths:
        if path.rpartition(".")[2] not in INPUT_KEYS:
            raise NotExportable(
                f'"{path}" cannot be an input: loads (NAME.function), motors and actuators (HINGE.rotation.torque_Nm, '
                "NAME.force_N) can; a prescribed motion needs its rate and acceleration: drive the hinge by its motor"
            )
    changed: Scene = scene.with_values({path: Constant(value=0.0) for path in paths})
    return changed


def candidates(scene: Scene) -> Iterator[Candidate]:
    """All numbers of the kinds that may be changed, in the order of the scene."""
    for axis, word in enumerate("xyz"):
        yield Candidate(f"gravity_m_s2.{axis}", f"gravity_m_s2.{word}", "m/s²")
    items = [(key, item) for key in COLLECTIONS for item in getattr(scene, key)]
    names = [item.name for _, item in items]
    for key, item in items:
        if key == "bodies" and not isinstance(item, RigidBody):
            continue
        if "." in item.name:  # a path could not be read
            continue
        own = f"{key}.{item.name}" if names.count(item.name) > 1 else item.name
        yield from _inside(item, f"{key}.{item.name}", own)


def _inside(struct: msgspec.Struct, path: str, name: str) -> Iterator[Candidate]:
    for key in struct.__struct_fields__:
        value, stem_unit = getattr(struct, key), split_unit(key)
        if isinstance(value, Function):
            yield from _of_function(struct, key, value, f"{path}.{key}", name)
        elif isinstance(value, float) and stem_unit[0] in STEMS and not _idle(struct, stem_unit[0]):
            yield Candidate(f"{path}.{key}", f"{name}.{key}", stem_unit[1])
        elif isinstance(value, msgspec.Struct):
            yield from _inside(value, f"{path}.{key}", f"{name}.{key}")
        elif isinstance(value, tuple):
            for i, part in enumerate(value):
                if isinstance(part, msgspec.Struct):
                    yield from _inside(part, f"{path}.{key}.{i}", f"{name}.{key}[{i}]")


def _idle(struct: msgspec.Struct, stem: str) -> bool:
    """Whether a number says where a spring is at rest that is not there."""
    return stem == "rest" and isinstance(struct, AngularCoordinate | LinearCoordinate) and not struct.spring[0]


def _of_function(struct: Any, key: str, function: Any, path: str, name: str) -> Iterator[Candidate]:
    if isinstance(struct, Load):
        unit, name = {"force": "N", "torque": "N m"}[struct.type], f"{name}.{struct.type}"
    else:
        unit, name = split_unit(key)[1], f"{name}.{key}"
    if isinstance(function, Constant) and key in INPUT_KEYS:
        yield Candidate(f"{path}.value", name, unit, is_input=True)
        return
    for part, more in FUNCTION_KEYS.items():
        if isinstance(getattr(function, part, None), float):
            yield Candidate(f"{path}.{part}", f"{name}.{part}", unit + more, is_prescribed=key not in INPUT_KEYS)


def numbers(scene: Scene, base: Image, block: Callable[[Scene], Image | None]) -> Numbers:
    """The numbers of a scene that can be changed in a block, the present one being `base`.

    block: the block of the scene with other numbers, None if it needs other kernels or tables of other sizes.
    """
    found, fixed = list[Changeable](), dict[str, str]()
    for place, candidate in enumerate(candidates(scene)):
        if place >= MOST:
            fixed[candidate.name] = f"only the first {MOST} numbers are looked at"
            continue
        number = Number(scene, candidate.path)
        step = number.scale
        first, second = (block(number.scene_at(number.value + n * step)) for n in (1.0, 2.0))
        if first is None or second is None:
            fixed[candidate.name] = "its change adds or removes a term of the equations"
            continue
        effects = affine(base.words, first.words, second.words, step)
        if effects is None:
            fixed[candidate.name] = "it takes part in quantities that are computed from it"
        elif effects or candidate.is_input:
            found.append(Changeable(candidate, number.value, effects))
    kept = _independent(scene, base, found, fixed, block)
    return Numbers(tuple(sorted(kept, key=lambda each: not each.candidate.is_input)), fixed)


def affine(base: Real, first: Real, second: Real, step: float) -> tuple[Effect, ...] | None:
    """The effects of a number whose words are these after one and two steps; None if one is not affine."""
    bits = [words.view(np.int64) for words in (base, first, second)]
    places = np.flatnonzero((bits[0] != bits[1]) | (bits[0] != bits[2]))
    b, one, two = base[places], first[places], second[places]
    sizes = np.abs(b) + np.abs(one) + np.abs(two)
    if np.any(sizes < TINY) or not np.all(np.isfinite(sizes)):
        return None
    if np.any(np.abs(two - 2.0 * one + b) > ROUNDING * sizes):
        return None
    slopes = (two - b) / (2.0 * step)
    return tuple(Effect(int(word), float(slope)) for word, slope in zip(places, slopes, strict=True))


def _independent(
    scene: Scene, base: Image, found: list[Changeable], fixed: dict[str, str],
    block: Callable[[Scene], Image | None],
) -> list[Changeable]:  # fmt: skip
    """Those that may be changed together: where a word then is not the sum of their effects, the last stay fixed."""
    kept = list(found)
    while kept:
        scales = (Number(scene, each.candidate.path).scale for each in kept)
        moves = [
            (each, (0.3 + 0.4 * (n % 7) / 7.0) * scale)
            for n, (each, scale) in enumerate(zip(kept, scales, strict=True))
        ]
        values: Mapping[str, float] = {each.candidate.path: each.value + move for each, move in moves}
        together = block(scene.with_values(values))
        wrong: set[int] | None = None
        if together is not None:
            expected = base.words.copy()
            size = np.abs(base.words)
            for each, move in moves:
                for word, slope in each.effects:
                    expected[word] += slope * move
                    size[word] += abs(slope * move)
            touched = sorted({word for each in kept for word, _ in each.effects})
            same = base.words.view(np.int64) == together.words.view(np.int64)
            same[touched] = np.abs(expected[touched] - together.words[touched]) <= ROUNDING * size[touched]
            wrong = set(np.flatnonzero(~same).tolist())
            if not wrong:
                return kept
        clash = [each for each in kept if wrong is None or any(word in wrong for word, _ in each.effects)]
        dropped = clash[-1] if clash else kept[-1]
        kept.remove(dropped)
        fixed[dropped.candidate.name] = "it acts together with another number that can be changed"
    return kept
