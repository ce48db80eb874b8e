"""Runs that were stored as CSV or `.npz`, as `Trajectory.to_csv` and `to_npz` write them, for a look at them."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from flexmb.output.files import from_text
from flexmb.run.run_arrays import labels
from flexmb.scene.functions import ControlSignal
from flexmb.scene.problems import closest
from flexmb.scene.reading import REAL, TEXT, Unreadable, unpacked
from flexmb.scene.schema import Scene
from flexmb.system.compile import assembled
from flexmb.tables.state import State
from flexmb.typing import Real
from flexmb.view.scene_view import View, applied_at, scene_view

CSV, NPZ = "trajectory.csv", "trajectory.npz"
UNIT = re.compile(r" \[[^][]*\]$")


def stored_columns(path: Path) -> dict[str, Real]:
    """The columns (T,) of a stored run by name, time "t" (s) among them; `path` is its file, or its folder.

    ValueError for a file that is none, OSError for one that cannot be read.
    """
    if path.is_dir():
        path = next((path / name for name in (CSV, NPZ) if (path / name).exists()), path / CSV)
    if path.suffix.lower() not in (".csv", ".npz"):
        raise ValueError(f"{path}: a stored run is a .csv or .npz of `flexmb simulate`, or the folder that it wrote")
    columns = _from_csv(path) if path.suffix.lower() == ".csv" else _from_npz(path)
    if "t" not in columns or not len(columns["t"]):
        raise ValueError(f"{path}: this is no stored run with output times: it has no column `t [s]`, or no rows")
    return columns


def stored_view(scene: Scene, path: Path) -> View:
    """The view of a stored run of a scene, with the loads at its hinges and closures that the file has.

    ValueError if the file is none of a run of this scene.
    """
    columns = stored_columns(path)
    system = assembled(scene)
    names, speeds = system.state_names
    q, u = (_table(columns, [name for name, _ in part], path) for part in (names, speeds))
    states = list(map(State, q, u, columns["t"].tolist()))
    loads = {}
    moving = [mass for mass in scene.point_masses if mass.directions]
    for each in (*scene.hinges, *moving, *scene.closures):
        wanted = [name for name, _ in labels("loads", each.name, 6)]
        if all(name in columns for name in wanted):
            loads[each.name] = _table(columns, wanted, path)
    steered = [load.name for load in scene.loads if isinstance(load.function, ControlSignal)]
    applied = applied_at([system] * len(states), states)
    notes = []
    if steered:
        notes.append(f"No arrows of loads that a controller sets, as a stored run has none: {', '.join(steered)}.")
    if scene.loads and scene.events:
        notes.append("Loads from outside are those of the scene, as if no event had changed them.")
    return scene_view(
        [system.scene] * len(states), states, [name for name, _ in names], f"stored run to t = {states[-1].t:g} s",
        loads, applied={name: load for name, load in applied.items() if name not in steered}, notes=notes,
    )  # fmt: skip


def _table(columns: Mapping[str, Real], names: Sequence[str], path: Path) -> Real:
    """Columns (T,n) by name; ValueError if one is missing."""
    for name in names:
        if name not in columns:
            raise ValueError(f"{path}: there is no column {name!r}, so it is a run of another scene: "
                             f"{closest(name, columns)}")  # fmt: skip
    return np.stack([columns[name] for name in names], axis=1) if names else np.zeros((len(columns["t"]), 0))


def _from_csv(path: Path) -> dict[str, Real]:
    try:
        with path.open(newline="", encoding="utf-8") as file:
            header, *rows = list(csv.reader(file)) or [[]]
        values = np.array(rows, dtype=float).reshape(len(rows), len(header))
    except (ValueError, csv.Error) as error:
        raise ValueError(f"{path}: not every row has a number for every column: {error}") from None
    return {UNIT.sub("", from_text(cell)): values[:, i] for i, cell in enumerate(header)}


def _from_npz(path: Path) -> dict[str, Real]:
    try:
        stored = unpacked(path, dict.fromkeys(("names", "units", "scene"), TEXT) | {"values": REAL})
        names, values = stored["names"], stored["values"]
    except (KeyError, Unreadable) as error:
        raise ValueError(f"{path}: this is no stored run, but perhaps a restart: {error}") from None
    if names.ndim != 1 or values.ndim != 2 or len(names) != values.shape[1]:
        raise ValueError(f"{path}: {names.shape} names for values of the shape {values.shape} are no columns")
    return {str(name): values[:, i] for i, name in enumerate(names)}
