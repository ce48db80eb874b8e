"""A scene by an FMU: runs of it, and its variables as what engines exchange."""

from __future__ import annotations

import shutil
import tempfile
import time
import weakref
from collections.abc import Mapping
from math import inf
from pathlib import Path
from typing import Any, NamedTuple, assert_never

import numpy as np

from crosscheck.engines.contract import ENERGIES, Effort, MarkerPath, MarkerSnapshot, Run, Snapshot, Trajectory
from crosscheck.engines.conventions import quaternion_of
from crosscheck.engines.fmu.archive import FmuArchive, FmuVariable, Interface
from crosscheck.engines.fmu.columns import states
from crosscheck.engines.fmu.exchange import exchanged
from crosscheck.engines.fmu.instance import Instance
from crosscheck.engines.fmu.kinematics import Kinematics
from crosscheck.engines.fmu.layout import MappedColumns
from crosscheck.engines.fmu.stepping import stepped
from crosscheck.engines.trajectories import continuous
from flexmb.scene.schema import Scene
from flexmb.typing import Real

NO_ROTATION = 1e-5  # of the norm of a quaternion, and of the products of the columns of a matrix: what is off is none
CLOSING = 1e5
"""By so many of CVode's tolerances an exported chain may open before it closes itself. What is less is an error of the
integration as any other, and falls with it; every closing makes CVode begin anew, with its lowest order."""
USUAL_TOLERANCE = 1e-8  # of Model Exchange where nothing is integrated


class FmuInterface(NamedTuple):
    """How an FMU is run: its interface, and the parameter that is set to the communication step, if there is one."""

    interface: Interface
    step: FmuVariable | None = None


class FmuModel:
    """An FMU unpacked into a folder that is removed with the model; every run has an instance of its own."""

    def __init__(self, archive: FmuArchive, layout: MappedColumns, way: FmuInterface, scene: Scene) -> None:
        from fmpy import extract

        self._archive, self._layout, self._way, self._scene = archive, layout, way, scene
        self._folder = Path(tempfile.mkdtemp(prefix="crosscheck-fmu-"))
        weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        extract(str(archive.path), self._folder)
        self._variables = layout.variables
        values = ((setting.variable, setting.value(scene)) for setting in layout.settings)
        self._values = tuple((variable, value) for variable, value in values if value != variable.start)
        self._kinematics = Kinematics(scene) if layout.coordinates else None

    def warm_up(self) -> None:
        """Load its library once."""
        self._instance().close()

    def evaluate(self) -> Snapshot:
        """What the FMU gives at its start, t = 0."""
        instance, rows = self._instance(), list[list[float]]()
        try:
            instance.start(0.0, USUAL_TOLERANCE, self._values)
            if self._way.interface == "model exchange":
                instance.events()
            rows.append(instance.get(self._variables))
        finally:
            instance.close()
        return _snapshot(self._outputs(np.zeros(1), rows), self._layout, self._columns(rows))

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        """Run with an instance of its own; an error of the FMU cuts the run, and its message says when and why."""
        instance, rows = self._instance(), list[list[float]]()
        tolerance = effort.value if effort.kind == "tolerance" else None
        values = list(self._values)
        if self._way.step is not None and effort.kind == "step":
            values.append((self._way.step, effort.value))
        evaluations, begun = 0, time.perf_counter()

        def sample() -> None:
            rows.append(instance.get(self._variables))

        told = tolerance
        if tolerance is not None and self._archive.own is not None:
            told = CLOSING * tolerance
        try:
            instance.start(run.t_start, told, values)
            match self._way.interface:
                case "model exchange":
                    assert tolerance is not None  # the engine's efforts
                    evaluations, steps, message = exchanged(instance, run.times, tolerance, sample)
                case "co-simulation":
                    steps, message = stepped(instance, run.times, inf if tolerance else effort.value, sample)
                case _:
                    assert_never(self._way.interface)
        finally:
            instance.close()
        wall = time.perf_counter() - begun
        outputs = self._outputs(run.times[: len(rows)], rows)
        return Trajectory(
            status="finished" if len(rows) == len(run.times) and not message else "diverged", message=message,
            times=run.times[: len(rows)].copy(), wall_s=wall, evaluations=evaluations, steps=steps, **outputs,
        )  # fmt: skip

    def _instance(self) -> Instance:
        return Instance(self._archive, self._folder, self._way.interface)

    def _columns(self, rows: list[list[float]]) -> dict[str, Real]:
        """Every mapped column (T,) in SI."""
        raw = np.array(rows, dtype=float).reshape(len(rows), len(self._variables))
        place = {variable: i for i, variable in enumerate(self._variables)}
        return {
            name: source.offset + (source.factor * raw[:, place[source.variable]] if source.variable is not None
                                   else np.zeros(len(rows)))
            for name, source in self._layout.columns.items()
        }  # fmt: skip

    def _outputs(self, times: Real, rows: list[list[float]]) -> dict[str, Any]:
        """Everything that the layout gives, as fields of a trajectory."""
        columns = self._columns(rows)
        found: dict[str, Any] = {
            kind: {} for kind in ("markers", "loads", "total_loads", "wheel_loads", "connectors", "drives",
                                  "hinge_forces", "energy")
        }  # fmt: skip
        for group, names in self._layout.given:
            values = np.stack([columns[name] for name in names], axis=1)
            match group.kind:
                case "marker":
                    found["markers"][group.name] = _path(group.name, values)
                case "load" | "total_load" | "wheel_load" | "connector" | "drive" | "hinge_force":
                    found[f"{group.kind}s"][group.name] = values
                case "energy":
                    found["energy"] = {kind: values[:, i] for i, kind in enumerate(ENERGIES)}
                case "momentum":
                    found["momentum"] = values
                case "work":
                    found["work"] = values[:, 0] - (values[0, 0] if len(values) else 0.0)
                case "acceleration":
                    pass  # of snapshots alone
                case _:
                    assert_never(group.kind)
        if self._kinematics is not None and len(rows):
            moving = {name: columns[name] for name in states(self._scene) if name in columns}
            found["markers"] = self._kinematics.paths(times, moving) | found["markers"]
        return found


def _path(name: str, values: Real) -> MarkerPath:
    """A marker from position, quaternion or matrix, and velocities: (T,13) or (T,18). ValueError for no rotation."""
    turn = values[:, 3:-6]
    finite = np.flatnonzero(np.isfinite(turn).all(axis=1))
    quaternions, off = np.full((len(turn), 4), np.nan), np.zeros(len(turn))
    if turn.shape[1] == 9:
        matrices = turn[finite].reshape(-1, 3, 3)
        product = np.einsum("tij,tik->tjk", matrices, matrices) - np.eye(3)
        right_handed = np.einsum("ti,ti->t", matrices[:, 0], np.cross(matrices[:, 1], matrices[:, 2]))
        off[finite] = np.max(np.abs(product), axis=(1, 2), initial=0.0) + np.abs(right_handed - 1.0)
        quaternions[finite] = np.array([quaternion_of(each) for each in matrices]).reshape(-1, 4)
    else:
        norms = np.linalg.norm(turn[finite], axis=1)
        off[finite] = np.abs(norms - 1.0)
        quaternions[finite] = turn[finite] / np.where(norms > 0.0, norms, 1.0)[:, None]
    if wrong := np.flatnonzero(off > NO_ROTATION).tolist():
        kind = "matrix" if turn.shape[1] == 9 else "quaternion"
        raise ValueError(
            f'the {kind} of marker "{name}" is no rotation at sample {wrong[0]}: it is {off[wrong[0]]:.2g} off; look '
            "at the order of its elements in the mapping"
        )
    return MarkerPath(values[:, :3].copy(), continuous(quaternions), values[:, -6:].copy())


def _snapshot(outputs: Mapping[str, Any], layout: MappedColumns, columns: Mapping[str, Real]) -> Snapshot:
    """The first sample."""
    accelerations = {
        group.name: np.array([columns[name][0] for name in names])
        for group, names in layout.given
        if group.kind == "acceleration"
    }

    def first(name: str) -> dict[str, Any]:
        return {item: values[0] for item, values in outputs[name].items()}

    momentum = outputs.get("momentum")
    return Snapshot(
        markers={
            name: MarkerSnapshot(path.position[0], path.quaternion[0], path.velocity[0], accelerations.get(name))
            for name, path in outputs["markers"].items()
        },
        loads=first("loads"), wheel_loads=first("wheel_loads"), drives=first("drives"),
        energy={kind: float(values[0]) for kind, values in outputs["energy"].items()},
        momentum=None if momentum is None else momentum[0], connectors=first("connectors"),
        hinge_forces=first("hinge_forces"), total_loads=first("total_loads"),
    )  # fmt: skip
