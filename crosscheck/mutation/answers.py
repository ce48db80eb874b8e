"""Faults planted in an engine's answer, such as an adapter makes in converting correct numbers.

Each changes the run that an engine returned. Mutations of scenes are slips in the data, these are slips in
conventions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from crosscheck.engines.contract import ENERGIES, OUTPUTS, MarkerPath, Trajectory
from crosscheck.engines.linear.parts import DERIVATIVES, FREQUENCIES
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.quaternions import rotation_matrix
from flexmb.scene.schema import Scene
from flexmb.scene.tree import rest_frames
from flexmb.typing import Real

MILLI = 1e3
SHIFT = 0.01  # of the scene's extent
ALONG = ("drive", "hinge_force")  # channels with one part, named after a hinge, wheel or connector

Falsify = Callable[[Trajectory, Scene], Trajectory]


@dataclass(frozen=True)
class AnswerFault:
    """One fault of an adapter: its effect, the slip that it represents, and the function that changes a run."""

    name: str
    what: str
    slip: str
    falsify: Falsify


def _with(run: Trajectory, output: str, instead: Any) -> Trajectory:
    return replace(run, **{output: instead})


def _reversed(output: str) -> Falsify:
    """An output that is given by item, with the opposite sign."""

    def falsify(run: Trajectory, scene: Scene) -> Trajectory:
        return _with(run, output, {name: -values for name, values in getattr(run, output).items()})

    return falsify


def _about_another_point(output: str) -> Falsify:
    """Torques about a point displaced by `SHIFT` of the scene's extent along (1, 1, 1)."""

    def falsify(run: Trajectory, scene: Scene) -> Trajectory:
        extent = max((float(np.max(np.abs(path.position))) for path in run.markers.values()), default=1.0) or 1.0
        arm = np.full(3, SHIFT * extent)

        def shifted(load: Real) -> Real:
            return np.hstack([load[:, :3] + np.cross(arm, load[:, 3:]), load[:, 3:]])

        return _with(run, output, {name: shifted(load) for name, load in getattr(run, output).items()})

    return falsify


def _in_body_axes(output: str, loaded: Callable[[Scene], Iterable[tuple[str, str]]]) -> Falsify:
    """Loads in the axes of a marker on the body that they act on, if there is one; `loaded` gives items and bodies."""

    def falsify(run: Trajectory, scene: Scene) -> Trajectory:
        shown = {marker.body: run.markers[marker.name] for marker in scene.markers if marker.name in run.markers}
        loads = dict(getattr(run, output))
        for name, body in loaded(scene):
            if body in shown and name in loads:
                loads[name] = _in_axes(shown[body], loads[name])
        return _with(run, output, loads)

    return falsify


def _by_hinges(scene: Scene) -> list[tuple[str, str]]:
    return [(hinge.name, hinge.child) for hinge in scene.hinges]


def _by_connectors(scene: Scene) -> list[tuple[str, str]]:
    return [(connector.name, connector.body_b) for connector in scene.connectors if isinstance(connector, BetweenNodes)]


def _on_paths(change: Callable[[MarkerPath], MarkerPath]) -> Falsify:
    return lambda run, scene: replace(run, markers={name: change(path) for name, path in run.markers.items()})


def _transposed(path: MarkerPath) -> MarkerPath:
    return replace(path, quaternion=path.quaternion * np.array([1.0, -1.0, -1.0, -1.0]))


def _scalar_last(path: MarkerPath) -> MarkerPath:
    return replace(path, quaternion=np.roll(path.quaternion, -1, axis=1))


def _body_velocity(path: MarkerPath) -> MarkerPath:
    turned = _in_axes(path, path.velocity)
    return replace(path, velocity=np.hstack([path.velocity[:, :3], turned[:, 3:]]))


def _body_rates(path: MarkerPath) -> MarkerPath:
    turned = _in_axes(path, path.velocity)
    return replace(path, velocity=np.hstack([turned[:, :3], path.velocity[:, 3:]]))


def _degrees(path: MarkerPath) -> MarkerPath:
    return replace(path, velocity=np.hstack([np.degrees(path.velocity[:, :3]), path.velocity[:, 3:]]))


def _millimetres(path: MarkerPath) -> MarkerPath:
    return replace(path, position=MILLI * path.position)


def _wheels_left_out(run: Trajectory, scene: Scene) -> Trajectory:
    """The angular momentum without that of the wheels' initial spin, along their axes by markers of their bodies."""
    if run.momentum is None:
        return run
    momentum = run.momentum.copy()
    bodies = {body.name: body for body in scene.bodies}
    for wheel in scene.wheels:
        path = next((run.markers[marker.name] for marker in scene.markers if marker.body == wheel.body), None)
        marker = next((marker for marker in scene.markers if marker.body == wheel.body), None)
        if path is None or marker is None:
            continue
        frames = rest_frames(bodies[wheel.body])
        to_marker = rotation_matrix(frames[marker.node].quaternion).T @ rotation_matrix(frames[wheel.node].quaternion)
        axis = np.asarray(wheel.axis) / np.linalg.norm(wheel.axis)
        spin = wheel.axial_inertia_kg_m2 * wheel.speed_rad_s * (to_marker @ axis)
        momentum[:, :3] -= rotation_matrix(path.quaternion) @ spin
    return replace(run, momentum=momentum)


def _energy_left_out(kind: str) -> Falsify:
    def falsify(run: Trajectory, scene: Scene) -> Trajectory:
        energy = {name: 0.0 * values if name == kind else values for name, values in run.energy.items()}
        return replace(run, energy=energy)

    return falsify


def _work_reversed(run: Trajectory, scene: Scene) -> Trajectory:
    return replace(run, work=None if run.work is None else -run.work)


def _matrices(change: Callable[[Real], Real], *names: str) -> Falsify:
    """Derivatives of these names, by default all, with every matrix (n, n) changed."""

    def falsify(run: Trajectory, scene: Scene) -> Trajectory:
        derivatives = dict(run.derivatives)
        for name in names or derivatives:
            if name in derivatives:
                n = round(np.sqrt(derivatives[name].shape[1]))
                derivatives[name] = change(derivatives[name].reshape(-1, n, n)).reshape(-1, n * n)
        return replace(run, derivatives=derivatives)

    return falsify


def _in_hertz(run: Trajectory, scene: Scene) -> Trajectory:
    return replace(run, frequencies=None if run.frequencies is None else run.frequencies / (2.0 * np.pi))


def _late(run: Trajectory, scene: Scene) -> Trajectory:
    """Every sample is the one before it."""
    at = np.maximum(np.arange(len(run.times)) - 1, 0)

    def before(output: Any) -> Any:
        if isinstance(output, dict):
            return {name: values[at] for name, values in output.items()}
        return None if output is None else output[at]

    paths = {
        name: MarkerPath(path.position[at], path.quaternion[at], path.velocity[at])
        for name, path in run.markers.items()
    }
    return replace(run, markers=paths, **{name: before(getattr(run, name)) for name in OUTPUTS})


def _in_axes(path: MarkerPath, spatial: Real) -> Real:
    """Two World vectors a row (T,6) in the axes of a marker."""
    R = rotation_matrix(path.quaternion)
    return np.hstack([np.einsum("tji,tj->ti", R, part) for part in (spatial[:, :3], spatial[:, 3:])])


FAULTS = (
    AnswerFault(
        "load_reaction", "hinge loads negated", "load on the inboard body for that on the outboard", _reversed("loads")
    ),
    AnswerFault(
        "load_reference", "hinge torques about another point", "another reference point", _about_another_point("loads")
    ),
    AnswerFault(
        "load_axes",
        "hinge loads in body axes",
        "axes of the outboard body for World axes",
        _in_body_axes("loads", _by_hinges),
    ),
    AnswerFault(
        "connector_reaction",
        "loads of connectors negated",
        "load on body A for that on body B",
        _reversed("connectors"),
    ),
    AnswerFault(
        "connector_reference",
        "torques of connectors about another point",
        "another reference point",
        _about_another_point("connectors"),
    ),
    AnswerFault(
        "connector_axes",
        "loads of connectors in axes of body B",
        "axes of a body for World axes",
        _in_body_axes("connectors", _by_connectors),
    ),
    AnswerFault(
        "hinge_force_reaction",
        "loads of connectors along hinges negated",
        "what acts on the hinge for what resists it",
        _reversed("hinge_forces"),
    ),
    AnswerFault(
        "total_load_reaction", "total loads negated", "load of the body for that on it", _reversed("total_loads")
    ),
    AnswerFault(
        "wheel_load_reaction", "wheel loads negated", "load on the body for that on the wheel", _reversed("wheel_loads")
    ),
    AnswerFault(
        "drive_reaction",
        "drive loads negated",
        "load of the motion for load of the drive",
        _reversed("drives"),
    ),
    AnswerFault(
        "orientation_transposed", "conjugate quaternions", "World to body for body to World", _on_paths(_transposed)
    ),
    AnswerFault(
        "orientation_order", "quaternions scalar last", "another order of the components", _on_paths(_scalar_last)
    ),
    AnswerFault("velocity_axes", "velocities in body axes", "body axes for World axes", _on_paths(_body_velocity)),
    AnswerFault("rate_axes", "angular velocities in body axes", "body rates for space rates", _on_paths(_body_rates)),
    AnswerFault("rate_unit", "angular velocities in degrees", "degrees for radians", _on_paths(_degrees)),
    AnswerFault("position_unit", "positions in millimetres", "another unit", _on_paths(_millimetres)),
    AnswerFault(
        "momentum_of_wheels",
        "momentum without the wheels' spin",
        "wheels taken for part of their bodies",
        _wheels_left_out,
    ),
    *(
        AnswerFault(f"energy_{kind}", f"{kind} energy zero", "a kind of energy left out", _energy_left_out(kind))
        for kind in ENERGIES
    ),
    AnswerFault("work_sign", "work negated", "work done by the system for work done on it", _work_reversed),
    AnswerFault(
        "derivative_transposed",
        "derivatives transposed",
        "columns for rows",
        _matrices(lambda M: M.transpose(0, 2, 1)),
    ),
    AnswerFault(
        "derivative_order",
        "derivatives with coordinates in reverse order",
        "another order of the coordinates",
        _matrices(lambda M: M[:, ::-1, ::-1]),
    ),
    AnswerFault(
        "derivative_of_position",
        "no derivatives by displacements",
        "gravity and stiffness taken for constant",
        _matrices(lambda M: 0.0 * M, "by_displacement"),
    ),
    AnswerFault(
        "derivative_of_speed",
        "derivatives by speeds negated",
        "Coriolis and damping terms moved to the other side",
        _matrices(lambda M: -M, "by_speed"),
    ),
    AnswerFault("frequency_unit", "frequencies in Hz", "Hz for rad/s", _in_hertz),
    AnswerFault("late", "every sample is the one before it", "state before the step for that after it", _late),
)


def run_of(times: Real, channels: dict[str, Real]) -> Trajectory:
    """The run with these channels (T, k): the inverse of `channels_of`."""
    kinds = ("marker", "load", "total_load", "wheel_load", "connector", *ALONG)
    names: dict[str, dict[str, None]] = {kind: {} for kind in kinds}
    for channel in channels:
        kind, of_item, rest = channel.partition(":")
        if of_item:
            names[kind][rest if kind in ALONG else rest.rpartition(".")[0]] = None

    def pair(prefix: str, first: str, second: str) -> Real:
        return np.hstack([channels[f"{prefix}.{first}"], channels[f"{prefix}.{second}"]])

    return Trajectory(
        status="finished",
        message="",
        times=times,
        markers={
            name: MarkerPath(
                channels[f"marker:{name}.position"],
                channels[f"marker:{name}.orientation"],
                pair(f"marker:{name}", "angular_velocity", "velocity"),
            )
            for name in names["marker"]
        },
        loads={name: pair(f"load:{name}", "torque", "force") for name in names["load"]},
        total_loads={name: pair(f"total_load:{name}", "torque", "force") for name in names["total_load"]},
        wheel_loads={name: pair(f"wheel_load:{name}", "torque", "force") for name in names["wheel_load"]},
        drives={name: channels[f"drive:{name}"] for name in names["drive"]},
        connectors={name: pair(f"connector:{name}", "torque", "force") for name in names["connector"]},
        hinge_forces={name: channels[f"hinge_force:{name}"] for name in names["hinge_force"]},
        energy={kind: channels[f"energy.{kind}"][:, 0] for kind in ENERGIES if f"energy.{kind}" in channels},
        momentum=pair("momentum", "angular", "linear") if "momentum.linear" in channels else None,
        work=channels["work"][:, 0] if "work" in channels else None,
        derivatives={
            name: channels[f"derivatives.{name}"] for name in DERIVATIVES if f"derivatives.{name}" in channels
        },
        frequencies=channels.get(FREQUENCIES),
    )
