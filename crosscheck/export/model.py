"""A scene as the numbers of its equations of motion: bodies, joints of elementary freedoms, loads, markers.

Everything is by name and in SI. What a scene leaves to the reader of its schema is written out here: every joint is a
list of turns, slides, ball joints and free flights between two frames, wheels and point masses are bodies with a joint
of their own, and a beam is its modes and inertia points (`modal_data`). docs/export.md explains each key.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, assert_never

import msgspec
import numpy as np

from crosscheck.engines.conventions import rotation_matrix
from crosscheck.export.rebuild import RebuiltCase
from crosscheck.library.case_error import CaseError
from crosscheck.library.find import load_case
from crosscheck.running.plan import variant_scene
from flexmb.modal.flexible import flexible_model
from flexmb.modal.flexible_model import FlexibleModel, FlexibleNode, SecondOrder
from flexmb.modal.integrals import modal_integrals
from flexmb.scene.bodies import IDENTITY, ZERO, BeamBody, Body, ModalBody, Quaternion, RigidBody, SidBody, Vector
from flexmb.scene.freedoms import Ball, Floating, Freedom, ScalarFreedom
from flexmb.scene.functions import Function
from flexmb.scene.hinges import Hinge
from flexmb.scene.rigid_equivalent import rigid_equivalent, wheel_inertia
from flexmb.scene.schema import Level, PointMass, Scene, Wheel
from flexmb.scene.tree import ordered, rest_frames
from flexmb.typing import Real

FORMAT = "crosscheck export 1"
AS_IN_THE_SCENE = ("closures", "connectors", "sensors", "controllers", "events")
"""Parts whose keys are those of the scene file, as those of `beams` are: `schemas/scene.schema.json` explains them."""

Data = dict[str, Any]


def model_data(scene: Scene) -> tuple[Data, dict[str, Data]]:
    """The content of `model.json`, and of `modal/<body>.json` by the name of each flexible body.

    CaseError for a body that a SID file describes, and for one of level "linear" or "ruthless", whose truncated mass
    matrix these numbers do not say.
    """
    modal = {body.name: modal_data(flexible_model(body), body.level) for body in flexible_bodies(scene)}
    return tree_data(scene), modal


def flexible_bodies(scene: Scene) -> list[BeamBody | ModalBody]:
    """The bodies with modes. CaseError as for `model_data`."""
    return [body for body in scene.bodies if isinstance(body, BeamBody | ModalBody) and _deforms(body)]


def tree_data(scene: Scene) -> Data:
    """The content of `model.json`. CaseError as for `model_data`."""
    if scene.total_loads:
        name = scene.total_loads[0].name
        raise CaseError(f'an export has the loads of joints, and no sums of them: leave out the total load "{name}"')
    flexible = {body.name for body in flexible_bodies(scene)}
    branches = ordered(scene)
    bodies = [_body(branch.body, flexible) for branch in branches]
    joints = [_hinge(branch.hinge) for branch in branches]
    for wheel in scene.wheels:
        bodies.append(_wheel_body(wheel))
        joints.append(_leaf(wheel, f"wheel {wheel.name}", "wheel"))
    for point in scene.point_masses:
        bodies.append(_rigid(f"mass {point.name}", point.mass_kg, ZERO, np.zeros((3, 3)), {}))
        joints.append(_leaf(point, f"mass {point.name}", "point mass"))
    data: Data = {
        "format": FORMAT,
        "name": scene.name,
        "description": scene.description,
        "gravity_m_s2": scene.gravity_m_s2,
        "bodies": bodies,
        "joints": joints,
        "modal_states": {
            state.body: {"coordinates": state.coordinates, "rates": state.rates} for state in scene.modal_states
        },
        "beams": _plain([body for body in scene.bodies if isinstance(body, BeamBody) and body.level == "exact"]),
        "loads": _plain(scene.loads),
        "markers": _plain(scene.markers),
    }
    return data | {part: _plain(getattr(scene, part)) for part in AS_IN_THE_SCENE}


def _deforms(body: BeamBody | ModalBody) -> bool:
    match body.level:
        case "rigid":
            return False
        case "full" | "stiffened":
            return True
        case "exact":
            return False  # it has no modes: its strains and sections are as in the scene
        case "linear" | "ruthless":
            what = f'body "{body.name}" is of level "{body.level}"'
            raise CaseError(f'{what}, whose truncated mass matrix an export cannot say: take level "full"')
        case _:
            assert_never(body.level)


def _body(body: Body, flexible: set[str]) -> Data:
    if isinstance(body, SidBody):
        raise CaseError(f'body "{body.name}" is described by a SID file: convert it by `flexmb import`')
    if body.name in flexible:
        return {"name": body.name, "kind": "modal", "file": modal_file(body.name)}
    if isinstance(body, BeamBody) and body.level == "exact":
        return {"name": body.name, "kind": "beam"}
    rest = {name: (frame.position, frame.quaternion) for name, frame in rest_frames(body).items()}
    if isinstance(body, RigidBody):
        return _rigid(body.name, body.mass_kg, body.com_m, np.array(body.inertia_kg_m2), rest)
    same = rigid_equivalent(body)
    return _rigid(body.name, same.mass_kg, same.com_m, np.array(same.inertia_kg_m2), rest)


def modal_file(body: str) -> str:
    """The file of a flexible body beside `model.json`; characters that a path must not have are replaced."""
    return f"modal/{''.join(c if c.isalnum() or c in '-_.' else '_' for c in body)}.json"


def _rigid(
    name: str, mass: float, com: Vector, inertia: np.ndarray, nodes: dict[str, tuple[Vector, Quaternion]]
) -> Data:
    return {
        "name": name, "kind": "rigid", "mass_kg": mass, "mass_centre_m": com, "inertia_kg_m2": inertia.tolist(),
        "nodes": {node: _frame(position, quaternion) for node, (position, quaternion) in nodes.items()},
    }  # fmt: skip


def _wheel_body(wheel: Wheel) -> Data:
    return _rigid(f"wheel {wheel.name}", wheel.mass_kg, ZERO, wheel_inertia(wheel), {})


def _frame(position: Vector, quaternion: Quaternion) -> Data:
    return {"position_m": position, "rotation": rotation_matrix(quaternion).tolist()}


def _hinge(hinge: Hinge) -> Data:
    kind = str(hinge.__struct_config__.tag)
    return {
        "name": hinge.name, "kind": kind,
        "parent": hinge.parent, "parent_node": hinge.parent_node,
        "parent_offset": _frame(hinge.parent_position_m, hinge.parent_quaternion),
        "child": hinge.child, "child_node": hinge.child_node,
        "child_offset": _frame(hinge.child_position_m, hinge.child_quaternion),
        "freedoms": [_freedom(freedom) for freedom in hinge.freedoms],
    }  # fmt: skip


def _leaf(item: Wheel | PointMass, body: str, kind: str) -> Data:
    """The joint of a wheel or a point mass, whose body has its frame at the joint."""
    return {
        "name": item.name, "kind": kind, "parent": item.body, "parent_node": item.node,
        "parent_offset": _frame(item.offset_m, IDENTITY), "child": body, "child_node": "origin",
        "child_offset": _frame(ZERO, IDENTITY), "freedoms": [_freedom(freedom) for freedom in item.freedoms],
    }  # fmt: skip


def _freedom(freedom: Freedom) -> Data:
    match freedom:
        case ScalarFreedom(name=name, axis=axis, coordinate=coordinate, pitch=pitch):
            stiffness, damping, rest = coordinate.spring
            return {
                "motion": freedom.motion, "name": name, "axis": axis, "pitch_m_rad": pitch,
                "value": coordinate.value, "rate": coordinate.rate,
                "stiffness": stiffness, "damping": damping, "rest": rest,
                "effort": _function(coordinate.effort), "prescribed": _function(coordinate.prescribed),
            }  # fmt: skip
        case Ball(quaternion=quaternion, angular_velocity=omega, stiffness=stiffness, damping=damping):
            return {
                "motion": "ball", "quaternion": quaternion, "angular_velocity_rad_s": omega,
                "stiffness_Nm_rad": stiffness, "damping_Nms_rad": damping,
            }  # fmt: skip
        case Floating(position=position, quaternion=quaternion, angular_velocity=omega, velocity=velocity):
            return {
                "motion": "free", "position_m": position, "quaternion": quaternion,
                "angular_velocity_rad_s": omega, "velocity_m_s": velocity,
            }  # fmt: skip
        case _:
            assert_never(freedom)


def _function(function: Function | None) -> Any:
    return None if function is None else _plain(function)


def _plain(item: Any) -> Any:
    return msgspec.to_builtins(item)


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


# Equations of motion rebuilt from exported data, as a route to the reference of a case. A case's file calls it: `exact
# = rebuilt(__file__, rtol=1e-9)`. The route shares with flexmb the data that are exported, for flexible bodies their
# modes and inertia points, and nothing of the dynamics (`crosscheck/export/rebuild`).


def rebuilt(file: str, rtol: float) -> Callable[[Real], dict[str, Real]]:
    """The function `exact(times)` of a file in a case's folder, for the variant of its reference."""
    folder = Path(file).parent

    def exact(times: Real) -> dict[str, Real]:
        case = load_case(folder)
        if case.run.reference is None:
            raise CaseError(f"{folder / 'run.toml'}: it has no table [reference]")
        variant = case.run.variant(case.run.reference.variant)
        model = RebuiltCase(*model_data(variant_scene(case.scene(variant), variant)))
        channels = model.channels(times, model.integrate(times, rtol))
        return {name: np.asarray(values) for name, values in channels.items()}

    return exact
