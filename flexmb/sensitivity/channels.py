"""Derivatives of the channels of a trajectory, by the names of `Trajectory.columns`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from flexmb.control.wiring import wired
from flexmb.run.run_arrays import Kind, labels
from flexmb.run.trajectory import Trajectory
from flexmb.scene.problems import closest
from flexmb.scene.tree import watches_signals
from flexmb.sensitivity.blocks import ObservedRates
from flexmb.system.observables import ENERGIES
from flexmb.system.system import System
from flexmb.tables.state import DynamicsError
from flexmb.typing import Real


class Seen(NamedTuple):
    """What is known at one output time, or at several, in arrays (...,n,P): Y (n,P) of the state [q, u, ..., work],
    everything observable, and signals' derivatives (S,P)."""

    Y: Real
    observed: ObservedRates | None
    signals: Real | None


Channel = Callable[[Seen], Real]
"""The derivatives (...,P) of one channel."""
Named = tuple[str, Channel]
_LOADS: tuple[tuple[Kind, str, str], ...] = (
    ("loads", "loads", "hinges"), ("loads", "closures", "closures"), ("wheel_loads", "wheel_loads", "wheels"),
    ("connectors", "connectors", "connectors"),
)  # fmt: skip
"""Kinds of channels by the part of a row and the names that they have there."""


class Chosen(NamedTuple):
    """The channels that are asked for: names (K,), units (K,), values (T,K)."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Real

    @property
    def observed(self) -> bool:
        """Whether one of them is more than a part of the state or a signal."""
        return not all(name.startswith("signal.") for name in self.names)


def refuse_unknown_outputs(system: System, names: Sequence[str]) -> None:
    """ValueError or TypeError, before a run, for names of channels that it will not have.

    Loads of drives are looked for afterwards, since events may hold further coordinates.
    """
    if isinstance(names, str):
        raise TypeError(f"outputs are a list of names, not the string {names!r}: write [{names!r}]")
    scene = system.scene
    has_loop = bool(scene.controllers) or watches_signals(scene)
    known = [*channels(system, wired(system).names if has_loop else {})]
    if not names:
        raise ValueError(f"no outputs are named: give at least one of {', '.join(known)}")
    for name in names:
        if str(name).startswith("power."):
            raise NotImplementedError(f"output {name!r}: derivatives of powers of controllers are not available")
        if any(str(name).startswith(f"{total.name}.") for total in scene.total_loads):
            raise NotImplementedError(
                f"output {name!r}: derivatives of total loads are not available: take the loads of the joints where "
                "they are determined"
            )
        if name not in known and ".drive[" not in str(name):
            raise ValueError(f"there is no output {name!r}: {closest(str(name), known)}")


def refuse_undetermined(trajectory: Trajectory, names: Sequence[str]) -> None:
    """DynamicsError for channels of a finished run that redundant closures leave undetermined: a scalar of them has no
    value, and thus no gradient, and no measurement tells of it."""
    known = chosen(trajectory, [name for name in names if ".drive[" not in name] or ["work"])
    for name, values in zip(known.names, known.values.T, strict=True):
        if np.any(np.isnan(values)):
            raise DynamicsError(
                f'output "{name}" is not determined by the motion, because closures are redundant: take other outputs, '
                "or leave out the closures, or their directions, that others imply"
            )


def chosen(trajectory: Trajectory, names: Sequence[str]) -> Chosen:
    """The channels of these names; ValueError for others."""
    known = {name: (unit, values) for name, unit, values in trajectory.columns() if name != "t"}
    for name in names:
        if name not in known:
            raise ValueError(f"there is no output {name!r}: {closest(str(name), known)}")
    values = np.column_stack([known[name][1] for name in names])
    return Chosen(tuple(names), tuple(known[name][0] for name in names), values)


def channels(system: System, signals: dict[str, slice]) -> dict[str, Channel]:
    """All channels of a system, by name."""
    return dict(_all(system, signals))


def _all(system: System, signals: dict[str, slice]) -> Iterator[Named]:
    observation = system.observation
    names, columns = observation.names, observation.columns
    for i, (name, _) in enumerate((*system.state_names[0], *system.state_names[1])):
        yield name, _state(i)
    yield "work", _state(-1)
    start = {name: place.start for name, (place, _) in columns.items()}

    def each(kind: Kind, name: str, places: Sequence[int], channel: Callable[[int], Channel] = _row) -> Iterator[Named]:
        found = zip(labels(kind, name, len(places)), places, strict=True)
        return ((label, channel(place)) for (label, _), place in found)

    for i, name in enumerate(names.markers):
        first = start["markers"] + 24 * i
        yield from each("position", name, range(first, first + 3))
        yield from each("quaternion", name, range(4), partial(_quaternion, first + 3))
        yield from each("velocity", name, range(first + 12, first + 18))
        yield from each("acceleration", name, range(first + 18, first + 24))
    for kind, group, items in _LOADS:
        for i, name in enumerate(getattr(names, items)):
            yield from each(kind, name, range(start[group] + 6 * i, start[group] + 6 * i + 6))
    for name, speeds in names.driven.items():
        yield from each("drives", name, (start["drives"] + speeds).tolist())
    for i, name in enumerate(names.hinge_forces):
        yield from each("hinge_forces", name, [start["hinge_forces"] + i])
    for i, name in enumerate(ENERGIES):
        yield from each("energy", name, [start["energy"] + i])
    yield "energy.total", _sum(columns["energy"][0])
    yield from each("momentum", "", range(start["momentum"], start["momentum"] + 6))
    for name, place in signals.items():
        yield from each("signals", name, range(place.start, place.stop), _signal)


def value(system: System, channel: Channel, name: str, itself: Seen) -> float:
    """The value of a channel where a state, everything observable and signals are in one column each.

    All but quaternions are linear in these, so that they are read like derivatives along one direction.
    """
    marker, _, axis = name.rpartition(".quaternion.")
    observation = system.observation
    if marker not in observation.names.markers or axis not in "wxyz":
        return float(channel(itself)[0])
    assert itself.observed is not None
    first = observation.columns["markers"][0].start + 24 * list(observation.names.markers).index(marker) + 3
    R = itself.observed.row[first : first + 9].reshape(3, 3)
    return float(Rotation.from_matrix(R).as_quat(canonical=True, scalar_first=True)["wxyz".index(axis)])


def _state(i: int) -> Channel:
    return lambda seen: seen.Y[..., i, :]


def _row(i: int) -> Channel:
    def rates(seen: Seen) -> Real:
        assert seen.observed is not None
        return seen.observed.rates[..., i, :]

    return rates


def _sum(place: slice) -> Channel:
    def rates(seen: Seen) -> Real:
        assert seen.observed is not None
        return np.sum(seen.observed.rates[..., place, :], axis=-2)

    return rates


def _signal(i: int) -> Channel:
    def rates(seen: Seen) -> Real:
        assert seen.signals is not None
        return seen.signals[..., i, :]

    return rates


def _quaternion(first: int, k: int) -> Channel:
    """Component k of the quaternion of the rotation (9,) from `first` on, whose scalar part is not negative."""

    def rates(seen: Seen) -> Real:
        assert seen.observed is not None
        R, dR = seen.observed.row[..., first : first + 9], seen.observed.rates[..., first : first + 9, :]
        several = R.shape[:-1]
        R, dR = R.reshape(*several, 3, 3), dR.reshape(*several, 3, 3, -1)
        turn = np.einsum("...ijk,...lj->...ilk", dR, R)  # R' = turn R
        w = np.stack([turn[..., 2, 1, :], turn[..., 0, 2, :], turn[..., 1, 0, :]])
        q = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat(canonical=True, scalar_first=True)
        s, v = q[:, 0].reshape(*several, 1), q[:, 1:].T.reshape(3, *several, 1)
        i, j = k % 3, (k + 1) % 3
        return 0.5 * (s * w[k - 1] + w[i] * v[j] - w[j] * v[i] if k else -np.sum(v * w, axis=0))

    return rates
