"""A flexible body as numbers: inertia points, modes, stiffness, damping, nodes, and the modal integrals."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexmb.modal.flexible_model import FlexibleModel, FlexibleNode, SecondOrder
from flexmb.modal.integrals import modal_integrals
from flexmb.scene.schema import Level
from flexmb.typing import Real

INTEGRALS = ("s0", "s1", "J0", "J1", "J2", "C0", "C1", "M_ff", "spatial_mass")


def modal_data(model: FlexibleModel, level: Level) -> dict[str, Any]:
    """The content of `modal/<body>.json`: arrays of n points and m modes, in the order of `FlexibleModel`."""
    integrals = modal_integrals(model)
    points = {
        "mass_kg": model.mass, "position_m": model.position, "translation_modes": model.translation,
        "rotation_modes": model.rotation, "mass_centre_offset_m": model.com_offset, "inertia_kg_m2": model.inertia,
    }  # fmt: skip
    return {
        "level": level,
        "clamped": model.clamped,
        "modes": model.mode_count,
        "stiffness": _listed(model.stiffness),
        "damping": _listed(model.damping),
        "points": {name: _listed(values) for name, values in points.items()} | _field(model.second),
        "nodes": {name: _node(node) for name, node in model.nodes.items()},
        "integrals": {"mass": integrals.mass} | {name: _listed(getattr(integrals, name)) for name in INTEGRALS},
    }


def _node(node: FlexibleNode) -> dict[str, Any]:
    return {
        "position_m": _listed(node.position), "rotation": _listed(node.rotation),
        "translation_modes": _listed(node.translation), "rotation_modes": _listed(node.rotation_modes),
    } | _field(node.second)  # fmt: skip


def _field(second: SecondOrder | None) -> dict[str, Any]:
    if second is None:
        return {}
    return {"second_translation": _listed(second.translation), "second_rotation": _listed(second.rotation)}


def _listed(values: Real) -> Any:
    return np.asarray(values, dtype=float).tolist()
