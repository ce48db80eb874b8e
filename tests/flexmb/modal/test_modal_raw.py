"""Raw modal bodies: inline points and `.npz` give the same model."""

from __future__ import annotations

import numpy as np
import pytest

from flexmb.modal.flexible import flexible_model
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.modal.integrals import modal_integrals
from flexmb.scene.bodies import ModalBody, ModalNode
from flexmb.scene.modal_data import inertia_points
from tests.flexmb.modal.beam_references import EPS, beam

ARRAYS = ("mass", "position", "com_offset", "inertia", "translation", "rotation", "stiffness", "damping")


@pytest.fixture
def model() -> FlexibleModel:
    section = {"rotary_y_kg_m": 2e-3, "rotary_z_kg_m": 1e-3}
    return flexible_model(beam(2, 3, section, {"damping_ratio": 0.01}, points="rotary"))


def node(model: FlexibleModel, name: str) -> ModalNode:
    tip = model.nodes[name]
    return ModalNode(
        name=name,
        position_m=tuple(tip.position),
        translation_modes=tuple(map(tuple, tip.translation.T)),
        rotation_modes=tuple(map(tuple, tip.rotation_modes.T)),
        quaternion=(0.0, 1.0, 0.0, 0.0),
    )


def test_inline_and_file_are_the_beam_they_came_from(model, tmp_path):
    inline = ModalBody(
        name="inline",
        points=inertia_points(
            model.mass, model.position, model.translation, model.rotation, model.inertia, model.com_offset
        ),
        stiffness=tuple(map(tuple, model.stiffness)),
        damping=tuple(map(tuple, model.damping)),
        nodes=(node(model, "tip"),),
    )
    np.savez(
        tmp_path / "body.npz",
        mass=model.mass,
        position=model.position,
        translation_modes=model.translation,
        rotation_modes=model.rotation,
        inertia=model.inertia,
        stiffness=model.stiffness,
        damping=model.damping,
    )
    from_file = ModalBody(name="file", file="body.npz", boundary="free-free")
    for other in (flexible_model(inline), flexible_model(from_file, tmp_path)):
        for name in ARRAYS:
            assert np.array_equal(getattr(other, name), getattr(model, name)), name
        assert np.array_equal(modal_integrals(other).spatial_mass, modal_integrals(model).spatial_mass)
    read = flexible_model(inline)
    assert read.clamped
    assert set(read.nodes) == {"origin", "tip"}
    assert np.array_equal(read.nodes["tip"].translation, model.nodes["tip"].translation)
    assert read.nodes["tip"].rotation == pytest.approx(np.diag([1.0, -1.0, -1.0]), abs=EPS)
    assert not flexible_model(from_file, tmp_path).clamped


def test_wrong_shapes_are_refused_with_the_body_named(model):
    points = inertia_points(model.mass, model.position, model.translation)
    with pytest.raises(ValueError, match=r"modal body 'odd'.*stiffness.*shape"):
        flexible_model(ModalBody(name="odd", points=points, stiffness=((1.0,),)))
    short = ModalNode(name="short", position_m=(0, 0, 0), translation_modes=((0, 1, 0),), rotation_modes=())
    with pytest.raises(ValueError, match="node 'short' has 1 translation and 0 rotation modes, expected 3"):
        flexible_model(ModalBody(name="odd", points=points, nodes=(short,)))


def test_missing_file_is_reported(tmp_path):
    with pytest.raises(OSError, match=r"nowhere\.npz"):
        flexible_model(ModalBody(name="lost", file="nowhere.npz"), tmp_path)
