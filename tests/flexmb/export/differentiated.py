"""Derivatives that an exported model gives, against those of the system that it was made of."""

from __future__ import annotations

from typing import Any

import numpy as np

import flexmb as fm
from tests.flexmb.export.loaded import Instance

SPATIAL = [f"{part}.{axis}" for part in ("torque", "force") for axis in "xyz"]


def columns(instance: Instance, system: fm.System, unknowns: list[str]) -> Any:
    """(n,nq+nu) derivatives of unknowns by all coordinates and speeds."""
    return np.column_stack([instance.along(unknowns, {name: 1.0}) for name in names_of(system)])


def names_of(system: fm.System) -> list[str]:
    """Of all coordinates and speeds."""
    q, u = system.state_names
    return [name for name, _ in (*q, *u)]


def expected_rows(system: fm.System, state: fm.State) -> dict[str, Any]:
    """By the names of the variables of a model, derivatives by displacements and speeds side by side, (2nu,)."""
    d, found = system.evaluation_derivatives(state), dict[str, Any]()

    def put(names: list[str], of: Any) -> None:
        for i, name in enumerate(names):
            found[name] = np.concatenate([np.atleast_2d(part)[i] for part in (of.by_displacement, of.by_speed)])

    for name, marker in d.markers.items():
        put([f"{name}.position.{axis}" for axis in "xyz"], marker.position)
        put([f"{name}.{part}.{axis}" for part in ("angular_acceleration", "acceleration") for axis in "xyz"],
            marker.acceleration)  # fmt: skip
    for name, load in d.loads.items():
        put([f"{name}.{part}" for part in SPATIAL], load)
    for name, drive in d.drives.items():
        put([f"{name}.drive[0]"], drive)
    for name, energy in d.energy.items():
        put([f"energy.{name}"], energy)
    found["energy.total"] = sum(found[f"energy.{name}"] for name in d.energy)
    put([f"der({name})" for name, _ in system.state_names[1]], d.accelerations)
    return found


def errors(instance: Instance, system: fm.System, state: fm.State) -> dict[str, float]:
    """By variable, the largest difference of a derivative, relative to the largest one of the row; absolute, in parts
    of 1e-2, for smaller ones, as those of the loads of a free joint, which transmits none."""
    expected = {name: row for name, row in expected_rows(system, state).items() if name in instance.fmu.numbers}
    own = columns(instance, system, list(expected))
    motion = system.acceleration_derivatives(state).motion  # displacements move coordinates by these
    by_both = np.hstack([own[:, : system.nq] @ motion, own[:, system.nq :]])
    return {
        name: float(np.abs(one - row).max() / max(np.abs(row).max(), 1e-2))
        for (name, row), one in zip(expected.items(), by_both, strict=True)
    }
