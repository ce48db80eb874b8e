"""Rigid-body motions are shown as such; what truncation leaves open is estimated from a model with more modes."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from rich.console import Console

import flexmb as fm
from flexmb.linear.linear_tables import modes_table
from flexmb.linear.truncation import finer_scene, truncation
from flexmb.scene.shapes import beam_section, cuboid_inertia

SECTION = beam_section(E=7e10, G=2.7e10, A=2e-4, Iy=2e-9, Iz=2e-9, rho=2700)


def satellite(modes: int = 3) -> fm.Scene:
    """Free, with a panel on a damped hinge and a wheel: eight motions that nothing holds."""
    wanted = fm.Modes(count=modes, families=("bending_y",), damping_ratio=0.005)
    return (
        fm.SceneBuilder("satellite")
        .rigid_body("hub", mass=100.0, inertia=cuboid_inertia(100.0, (1.0, 1.0, 1.0)))
        .beam("panel", length=4.0, elements=8, section=SECTION, modes=wanted)
        .free("base", "ground", "hub")
        .revolute("yoke", "hub", "panel", parent_position=(0.5, 0.0, 0.0), axis=(1, 0, 0), damping=0.1)
        .wheel("wheel", "hub", axis=(0, 0, 1), mass=5.0, axial_inertia=0.05, transverse_inertia=0.03)
        .scene()
    )


def loaded(modes: int, static: bool = False) -> fm.Scene:
    """A cantilever with a heavy body at its tip: clamped eigenmodes converge slowly."""
    wanted = fm.Modes(count=modes, families=("bending_y",), static=static)
    return (
        fm.SceneBuilder("loaded")
        .beam("beam", length=2.0, elements=16, section=SECTION, modes=wanted)
        .rigid_body("bob", mass=20.0, inertia=(1.0, 1.0, 1.0))
        .weld("clamp", "ground", "beam")
        .weld("joint", "beam", "bob", parent_node="tip")
        .marker("end", "bob")
        .scene()
    )


def test_motions_that_nothing_holds() -> None:
    """Six of the hub, the wheel's and the yoke's, whose damper stops it; their eigenvalues are fifteen."""
    model = fm.linearize(satellite())
    free = [mode for mode in model.modes if mode.is_rigid_body]
    assert len(free) == 15 and {str(mode) for mode in free} == {"rigid-body motion"}
    assert model.rigid_body_shapes.shape == (11, 8)
    np.testing.assert_allclose(model.rigid_body_shapes.T @ model.rigid_body_shapes, np.eye(8), atol=1e-12)
    stiffness = model.A[11:, :11]
    assert np.abs(stiffness @ model.rigid_body_shapes).max() < 1e-9 * np.abs(stiffness).max()
    assert str(model.modes[-1]).startswith("no oscillation, -23")
    assert str(model.modes[-2]).startswith("9.9") and "damping ratio 0.005" in str(model.modes[-2])


def test_none_where_all_is_held() -> None:
    model = fm.linearize(loaded(2))
    assert model.rigid_body_shapes.shape == (2, 0)
    assert not any(mode.is_rigid_body for mode in model.modes)


def test_the_table_has_them_in_one_row() -> None:
    console = Console(width=160, record=True)
    scene = satellite()
    model = fm.linearize(scene)
    console.print(modes_table(model, truncation(model, scene)))
    text = console.export_text()
    assert "8 rigid-body motions: base.rotation.x" in text and "1-15" in text and "rigid" in text
    assert " nan" not in text.lower()
    assert "twice the modes of every beam." in text
    lines = [line for line in text.splitlines() if "panel.mode[" in line]
    assert len(lines) == 3 and all("e-0" in line for line in lines)


@pytest.mark.parametrize("count", [1, 2, 4])
def test_the_estimate_is_of_the_size_of_the_error(count: int) -> None:
    """Of a beam whose tip load its modes do not know, against attachment modes, which are exact for it."""
    exact = fm.linearize(loaded(6, static=True)).modes[0].natural_rad_s
    model = fm.linearize(loaded(count))
    found = truncation(model, loaded(count))
    error = model.modes[0].natural_rad_s / exact - 1.0
    assert error > 1e-6
    assert 0.4 * error < found.change[0] < 1.1 * error
    assert found.likeness[0] > 0.99
    assert abs(found.eigenvalues[0]) < model.modes[0].natural_rad_s  # by Rayleigh and Ritz


def test_growth_is_not_taken_for_decay() -> None:
    """A beam that stands on a hinge: both real eigenvalues have one shape, and each is matched with itself."""
    wanted = fm.Modes(count=2, families=("bending_y",))
    scene = (
        fm.SceneBuilder("upright", gravity=(-9.81, 0.0, 0.0))
        .beam("beam", length=2.0, elements=16, section=SECTION, modes=wanted)
        .revolute("foot", "ground", "beam")
        .scene()
    )
    model = fm.linearize(scene)
    found = truncation(model, scene)
    real = [i for i, mode in enumerate(model.modes) if mode.eigenvalue.imag == 0.0]
    assert len(real) == 2 and np.all(found.change[real] < 1e-3)


def test_with_the_modes_for_its_load_nothing_is_open() -> None:
    model = fm.linearize(loaded(6, static=True))
    assert truncation(model, loaded(6, static=True)).change[0] < 1e-9


@pytest.mark.parametrize("families", [("axial",), ("torsion",), ("bending_y", "axial", "torsion")])
@pytest.mark.parametrize("static", [False, True])
def test_a_finer_beam_has_the_modes_that_it_is_asked_for(families: tuple, static: bool) -> None:
    """Of one element, and of a shaft with a lump, whose sections have no rotary inertia."""
    lump = fm.TipMass(x_m=2.0, mass_kg=1.0, inertia_kg_m2=((0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.1)))
    wanted = fm.Modes(count=1, families=families, static=static)
    if families == ("torsion",) and static:
        wanted = fm.Modes(count=0, families=families, static=True)
    scene = (
        fm.SceneBuilder("shaft")
        .beam("beam", length=2.0, elements=2, section=SECTION, modes=wanted, points="line", tip_masses=[lump])
        .weld("clamp", "ground", "beam")
        .scene()
    )
    fm.check_scene(finer_scene(scene))
    found = truncation(fm.linearize(scene), scene)
    assert np.all(np.isfinite(found.change))


def test_a_bent_start_is_the_same_shape_in_more_modes() -> None:
    """The tip is where it was, to what the modes of a shorter list leave of each other: rounding."""
    bent = fm.scene.schema.ModalState(body="beam", coordinates=(0.02, -0.01), rates=(0.3, 0.1))
    scene = msgspec.structs.replace(loaded(2), modal_states=(bent,))
    tips = []
    for each in (scene, finer_scene(scene)):
        system = fm.compile(each)
        state = system.initial_state
        tip = system.evaluate(0.0, state.q, state.u).markers["end"]
        tips.append(np.concatenate([tip.position, tip.velocity]))
    np.testing.assert_allclose(tips[1], tips[0], rtol=1e-5, atol=1e-9)


def test_what_has_no_finer_model_is_named() -> None:
    points = fm.scene.modal_data.inertia_points(
        np.ones(3), np.arange(1.0, 4.0)[:, None] * (1, 0, 0), np.array([[[0.0], [0.1], [0.0]], [[0.0], [0.4], [0.0]],
                                                                        [[0.0], [1.0], [0.0]]])
    )  # fmt: skip
    scene = (
        fm.SceneBuilder("panel").modal_body("panel", points=points, stiffness=[[50.0]])
        .revolute("root", "ground", "panel", axis=(0, 1, 0), stiffness=10.0).scene()
    )  # fmt: skip
    model = fm.linearize(scene)
    found = truncation(model, scene)
    assert found.unrefined == ("panel",)
    np.testing.assert_allclose(found.change, 0.0, atol=1e-12)
