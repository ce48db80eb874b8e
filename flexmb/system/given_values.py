"""Names and units of the entries of q and u of a system; and the values that the initial state of a closed chain shall
keep: those of its scene, or those named for a run.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexmb.building.links import BodyLink
from flexmb.closure.given_values import AskedFor, Value, Wishes
from flexmb.scene.bodies import IDENTITY
from flexmb.scene.hinges import Free, Spherical
from flexmb.system.scene_arrays import SceneArrays
from flexmb.typing import Real

Names = tuple[tuple[str, str], ...]


def names_of_states(arrays: SceneArrays) -> tuple[Names, Names]:
    """((name, unit) of every entry of q, the same of u)."""
    scene = arrays.scene
    q, u = [("", "")] * arrays.nq, [("", "")] * arrays.nu
    for link in arrays.links:
        hinge = link.hinge.name
        in_q, in_u = link.kind.names(link.hinge)
        q[arrays.coordinate(hinge)] = [(f"{hinge}.{name}", unit) for name, unit in in_q]
        u[arrays.speed(hinge)] = [(f"{hinge}.{name}", unit) for name, unit in in_u]
    for body in scene.bodies:
        place = arrays.coordinate(f"{body.name}.modes")
        modes = range(place.stop - place.start)
        q[place] = [(f"{body.name}.mode[{n}]", "1") for n in modes]
        u[arrays.speed(f"{body.name}.modes")] = [(f"{body.name}.mode_rate[{n}]", "1/s") for n in modes]
    for wheel in scene.wheels:
        q[arrays.coordinate(wheel.name)] = [(f"{wheel.name}.angle", "rad")]
        u[arrays.speed(wheel.name)] = [(f"{wheel.name}.speed", "rad/s")]
    return tuple(q), tuple(u)


Given = Literal["guess", "scene", "state"] | NDArray[np.bool_]
"""Which values of a state must be kept: none, those that the scene gives, all, or those that are named (nq+nu+1,)."""


class _Item(NamedTuple):
    """A coordinate or quaternion: its indices in q, those of its rates in u, whether the scene marks it as given, and
    its default value, None for zeros."""

    q: tuple[int, ...]
    u: tuple[int, ...]
    marked: bool = False
    rest: tuple[float, ...] | None = None


def asked(system: SceneArrays, y: Real, named: NDArray[np.bool_] | None = None) -> AskedFor:
    """The values of y = [q, u, work] that the scene gives, or those that a run has `named` (nq+nu+1,)."""
    items = list(_items(system))
    known = named if named is not None else np.zeros(len(y), bool)
    coordinates = [((item.q, item.u), item) for item in items]
    speeds = [((tuple(system.nq + j for j in item.u), item.u), item) for item in items]
    prescribed = frozenset(np.flatnonzero(system.constants.speed["prescribed"] >= 0).tolist())

    def wishes(values: list[tuple[Value, _Item]]) -> Wishes:
        free = [(value, item) for value, item in values if value[0] and not prescribed.issuperset(value[1])]
        insisted = [value for value, item in free if (item.marked if named is None else np.any(known[list(value[0])]))]
        given = [
            value for value, item in free if value in insisted or item.marked or _is_given(y, value, item, system.nq)
        ]
        return Wishes(tuple(given), tuple(insisted))

    names = tuple(name for names in names_of_states(system) for name, _ in names)
    return AskedFor(
        wishes(coordinates), wishes(speeds), system.nq, tuple(_modes(system)), prescribed, names,
        is_marked=named is None,
    )  # fmt: skip


def everything(system: SceneArrays) -> AskedFor:
    """All values, for a state that was given as a whole."""
    names = tuple(name for names in names_of_states(system) for name, _ in names)
    return AskedFor(
        Wishes(tuple(((i,), ()) for i in range(system.nq))),
        Wishes(tuple(((system.nq + j,), (j,)) for j in range(system.nu))),
        system.nq, tuple(_modes(system)), frozenset(), names, is_marked=False,
    )  # fmt: skip


def _is_given(y: Real, value: Value, item: _Item, nq: int) -> bool:
    rest = item.rest if item.rest is not None and value[0][0] < nq else (0.0,) * len(value[0])
    return any(y[place] != default for place, default in zip(value[0], rest, strict=True))


def _items(system: SceneArrays) -> Iterator[_Item]:
    for link in system.links:
        name = link.hinge.name
        yield from _of_hinge(link, system.coordinate(name).start, system.speed(name).start)
        modes = f"{link.name}.modes"
        yield _Item(_all(system.coordinate(modes)), _all(system.speed(modes)))
    for wheel in system.scene.wheels:
        yield _Item(_all(system.coordinate(wheel.name)), _all(system.speed(wheel.name)))


def _modes(system: SceneArrays) -> Iterator[Value]:
    for link in system.links:
        q, u = (_all(place(f"{link.name}.modes")) for place in (system.coordinate, system.speed))
        yield (*q, *(system.nq + j for j in u)), u


def _of_hinge(link: BodyLink, q: int, u: int) -> Iterator[_Item]:
    hinge, kind = link.hinge, link.kind
    if not isinstance(hinge, Spherical | Free):
        for i, (_, coordinate) in enumerate(link.scalar):
            yield _Item((q + i,), (u + i,), coordinate.given)
        return
    turning = tuple(u + j for j in range(kind.speeds) if j not in kind.displacements)
    yield _Item(tuple(range(q + kind.quaternion, q + kind.quaternion + 4)), turning, hinge.given, IDENTITY)
    if kind.displacements:
        place = tuple(range(q, q + kind.quaternion))
        yield _Item(place, tuple(u + j for j in kind.displacements), hinge.given)


def _all(place: slice) -> tuple[int, ...]:
    return tuple(range(place.start, place.stop))
