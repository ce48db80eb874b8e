"""Other units of length, mass and time, by powers of two, which cause no rounding."""

from __future__ import annotations

from typing import Any, NamedTuple, assert_never, get_args

import msgspec

from crosscheck.library.time_functions import scaled, slowed
from crosscheck.mutation.invariances.counterpart import (
    Channels,
    Counterpart,
    Invariance,
    NotApplicable,
    without_events,
    without_feedback,
)
from crosscheck.mutation.invariances.linearised import Item, by_freedom, has_beam_modes, relation
from crosscheck.running.undetermined import undetermined
from flexmb.scene.bodies import BeamStation, ModalBody, SidBody
from flexmb.scene.connectors import (
    AlongHinge,
    AngularSpring,
    Bushing,
    Connector,
    HingeSpring,
    LinearSpring,
    SpringDamper,
)
from flexmb.scene.functions import Function
from flexmb.scene.keys import split_unit
from flexmb.scene.schema import Coupling, Load, ModalState, Scene, Waiver
from flexmb.scene.tree import coordinates, coupled
from flexmb.surrogate import modal_points
from flexmb.typing import Real

# Speeds, accelerations, forces, energies and all else have another factor than 1.
LENGTH, MASS, TIME = 0.5, 8.0, 0.25
UNUSUAL = get_args(Waiver)  # a scene in other units than SI says that its numbers are meant


class Dimension(NamedTuple):
    """Powers of length, mass and time."""

    length: int = 0
    mass: int = 0
    time: int = 0

    @property
    def factor(self) -> float:
        """The ratio of a number in the other units to that in SI."""
        return LENGTH**self.length * MASS**self.mass * TIME**self.time


Each = tuple[Any, ...]
"""The dimension of each number of a tuple, or of tuples within it."""


def _blocks(first: Dimension, mixed: Dimension, last: Dimension) -> Each:
    """The dimensions of a (6,6) matrix whose first and last three rows differ: rotation and translation, or reverse."""
    above, below = (first,) * 3 + (mixed,) * 3, (mixed,) * 3 + (last,) * 3
    return (above,) * 3 + (below,) * 3


NUMBER = Dimension()
FORCE, ENERGY = Dimension(1, 1, -2), Dimension(2, 1, -2)
EFFORT = {True: ENERGY, False: FORCE}  # along an angle, along a displacement
OF_COORDINATE = {True: NUMBER, False: Dimension(1)}
OF_UNIT = {
    "": NUMBER, "rad": NUMBER, "s": Dimension(time=1), "m": Dimension(1), "kg": Dimension(mass=1),
    "N": FORCE, "N m": ENERGY, "N m²": Dimension(3, 1, -2), "m/s": Dimension(1, 0, -1),
    "m/s²": Dimension(1, 0, -2), "rad/s": Dimension(time=-1), "kg/m": Dimension(-1, 1), "kg m": Dimension(1, 1),
    "kg m²": Dimension(2, 1), "N/m": Dimension(0, 1, -2), "N s/m": Dimension(0, 1, -1), "N m/rad": ENERGY,
    "N m s/rad": Dimension(2, 1, -1), "m/rad": Dimension(1), "s/rad": Dimension(time=1), "s/m": Dimension(-1, 0, 1),
    "1/m": Dimension(-1),
}  # fmt: skip
QUATERNIONS = ("quaternion_a", "quaternion_b")
# Of bushings: the first three rows and columns are of turns, the others of displacements.
OF_BUSHING = {
    "stiffness": _blocks(ENERGY, FORCE, Dimension(0, 1, -2)),
    "damping": _blocks(Dimension(2, 1, -1), Dimension(1, 1, -1), Dimension(0, 1, -1)),
}
# Of sections of beams: the first three rows and columns are of forces and strains, the others of moments.
OF_SECTION = {
    "stiffness": _blocks(FORCE, ENERGY, Dimension(3, 1, -2)),
    "inertia": _blocks(Dimension(-1, 1), Dimension(0, 1), Dimension(1, 1)),
}
# Of raw modal bodies, whose modal coordinates are numbers without unit.
OF_MODES = {
    "translation_modes": Dimension(1), "second_translation": Dimension(1), "stiffness": ENERGY,
    "damping": Dimension(2, 1, -1), "gravity_stiffness": Dimension(1, 1), "gradient_stiffness": Dimension(2, 1),
    "force_stiffness": Dimension(1),
}  # fmt: skip
OF_CHANNEL = {
    ".position": Dimension(1), ".velocity": Dimension(1, 0, -1), ".angular_velocity": Dimension(time=-1),
    ".force": FORCE, ".torque": ENERGY, ".linear": Dimension(1, 1, -1), ".angular": Dimension(2, 1, -1),
}  # fmt: skip


def _rescaled(scene: Scene) -> Counterpart:
    without_feedback(scene)
    without_events(scene)
    for body in scene.bodies:
        if isinstance(body, SidBody) or (isinstance(body, ModalBody) and body.file is not None):
            raise NotApplicable(f'body "{body.name}" keeps its numbers in a file')
    if scene.modal_states:  # the unit of a beam's modal coordinates is its modes', which are made with the model
        scene = modal_points(scene)
    drives, left_out = _drives(scene), undetermined(scene)  # the least loads that an engine may take are others then

    def back(times: Real, channels: Channels) -> Channels:
        return {name: rows / _factor(name, drives) for name, rows in channels.items() if name not in left_out}

    other = msgspec.structs.replace(_in_units(scene), couplings=_couplings(scene), allow=UNUSUAL)
    # modes that are made anew in other units round otherwise, and no engine tells by how much
    linear = None if has_beam_modes(other) else relation(scene, other, _ratios, ENERGY.factor, TIME)
    return Counterpart(other, back, clock=TIME, linear=linear)


def _ratios(item: Item) -> list[float]:
    """Of the displacements of an item in the other units to those in SI."""
    return by_freedom(
        item, lambda freedom, _: OF_COORDINATE[freedom.coordinate.ANGULAR].factor, (1.0,) * 3, (LENGTH,) * 3
    )


def _couplings(scene: Scene) -> tuple[Coupling, ...]:
    """Offsets in the unit of the coordinate that is led, ratios in that unit per unit of the coordinate that leads."""
    couplings = []
    for coupling in scene.couplings:
        led, *leading = (OF_COORDINATE[member.named.coordinate.ANGULAR].factor for member in coupled(scene, coupling))
        terms = tuple(
            msgspec.structs.replace(term, ratio=term.ratio * led / own)
            for term, own in zip(coupling.terms, leading, strict=True)
        )
        couplings.append(msgspec.structs.replace(coupling, terms=terms, offset=coupling.offset * led))
    return tuple(couplings)


def _factor(channel: str, drives: dict[str, float]) -> float:
    if channel.startswith(("drive:", "hinge_force:")):
        return drives[channel.partition(":")[2]]
    if channel.startswith(("energy.", "work")):
        return ENERGY.factor
    return next((unit.factor for ending, unit in OF_CHANNEL.items() if channel.endswith(ending)), 1.0)


def _drives(scene: Scene) -> dict[str, Any]:
    """Of hinges, wheels and point masses with prescribed motion, the factors of their drive loads; of connectors, of
    their loads."""
    factors: dict[str, Any] = {wheel.name: ENERGY.factor for wheel in scene.wheels}
    for item in (*scene.hinges, *scene.point_masses):
        prescribed = [coordinate for _, coordinate in coordinates(item) if coordinate.prescribed is not None]
        if prescribed:
            factors[item.name] = [EFFORT[coordinate.ANGULAR].factor for coordinate in prescribed]
    for connector in scene.connectors:
        if isinstance(connector, AlongHinge):
            factors[connector.name] = EFFORT[connector.ANGULAR].factor
    return factors


def _in_units(item: Any) -> Any:
    """A struct with all numbers converted by the units in their keys."""
    return msgspec.structs.replace(
        item, **{key: _converted(getattr(item, key), _dimension(item, key)) for key in item.__struct_fields__}
    )


def _dimension(item: msgspec.Struct, key: str) -> Dimension | Each:
    match item:
        case Load() if key == "function":
            return FORCE if item.type == "force" else ENERGY
        case ModalState() if key == "rates":
            return Dimension(time=-1)
        case BeamStation() if key in OF_SECTION:
            return NUMBER if getattr(item, key) is None else OF_SECTION[key]
    if isinstance(item, Connector) and not split_unit(key)[1]:
        return _without_unit(item, key)
    return OF_MODES[key] if key in OF_MODES else OF_UNIT[split_unit(key)[1]]


def _without_unit(connector: Connector, key: str) -> Dimension | Each:
    """Of what a connector has under a key that says no unit: matrices of bushings, stiffening, quaternions, words."""
    if isinstance(connector, Bushing) and key in OF_BUSHING:
        return OF_BUSHING[key]
    if isinstance(connector, SpringDamper | HingeSpring) and key == "stiffening":
        return _stiffening(connector)
    if key in QUATERNIONS or isinstance(getattr(connector, key), str):
        return NUMBER
    raise NotApplicable(f'connector "{connector.name}": nobody says the unit of "{key}"')


def _stiffening(spring: SpringDamper | AngularSpring | LinearSpring) -> Each:
    """Of what is multiplied with the second and higher powers of an angle or a displacement."""
    count = len(spring.stiffening)
    match spring:
        case AngularSpring():
            return (ENERGY,) * count
        case LinearSpring() | SpringDamper():
            return tuple(Dimension(-1 - n, 1, -2) for n in range(count))
        case _:
            assert_never(spring)


def _converted(value: Any, dimension: Dimension | Each) -> Any:
    if not isinstance(dimension, Dimension):
        return tuple(_converted(component, own) for component, own in zip(value, dimension, strict=True))
    if isinstance(value, Function):
        return slowed(scaled(value, dimension.factor), TIME)
    match value:
        case msgspec.Struct():
            return _in_units(value)
        case tuple():
            return tuple(_converted(component, dimension) for component in value)
        case float():
            return dimension.factor * value
    return value


RESCALED = Invariance("rescaled", "length, mass and time in other units, by powers of two", _rescaled)
