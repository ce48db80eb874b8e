"""Mass, mass centre and inertia, against momentum: an identity that holds for every scene and state."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

import flexmb as fm
from flexmb.scene.shapes import beam_section, cuboid_inertia
from tests.bounds import UNIT_ROUNDOFF

ROUNDING = 2.0**12 * UNIT_ROUNDOFF
BEAM = beam_section(E=7e10, G=2.7e10, A=2e-4, Iy=2e-9, Iz=3e-9, rho=2700)


def spacecraft(levels: Sequence[str] = ("full", "full")) -> fm.Scene:
    """A free hub with a wheel and a slosh mass, a beam on a hinge, a second beam that hangs at the first one's tip."""
    return (
        fm.SceneBuilder("spacecraft")
        .rigid_body("hub", mass=40.0, inertia=cuboid_inertia(40.0, (1.0, 0.8, 0.6)), com=(0.1, 0.0, -0.05))
        .beam("boom", length=3.0, elements=4, section=BEAM, modes=4, level=levels[0])
        .beam("arm", length=1.0, elements=4, section=BEAM, modes=2, level=levels[1])
        .free("base", "ground", "hub", position=(3.0, -2.0, 7.0), quaternion=(0.5, 0.5, -0.5, 0.5))
        .revolute("root", "hub", "boom", parent_position=(0.5, 0.0, 0.0), axis=(0, 1, 0), angle=0.4)
        .revolute("elbow", "boom", "arm", parent_node="tip", child_node="tip", axis=(0, 0, 1), angle=1.1)
        .wheel("wheel", "boom", node="tip", axis=(0.6, 0.0, 0.8), mass=2.0, axial_inertia=0.03,
               transverse_inertia=0.02, speed=200.0)
        .point_mass("slosh", "hub", offset=(0.0, 0.2, 0.0), mass=3.0, directions=[(0, 0, 1)])
        .scene()
    )  # fmt: skip


def bent(system: fm.System, seed: int = 3) -> fm.State:
    """Somewhere else, with modes that are not at rest."""
    random = np.random.default_rng(seed)
    state = system.initial_state
    for name in ("boom.modes", "arm.modes"):
        at = system.coordinate(name)
        state.q[at] = 0.05 * random.normal(size=at.stop - at.start)
    state.q[system.coordinate("slosh")] = 0.1
    return state


@pytest.mark.parametrize("levels", [("full", "full"), ("linear", "full"), ("stiffened", "rigid"), ("full", "ruthless")])
def test_momentum_of_a_rigid_motion(levels: Sequence[str]) -> None:
    """All hinges and modes held: linear momentum m v_c, angular momentum about the World's origin J_c w + c x m v_c."""
    system = fm.compile(spacecraft(levels))
    state = bent(system)
    found = system.mass_properties(state)
    R = fm.scene.quaternions.rotation_matrix(state.q[3:7])
    w, v = np.array([0.3, -0.2, 0.5]), np.array([1.0, 2.0, -0.7])  # of the free hinge: body axes
    u = np.zeros(system.nu)
    u[system.speed("base")] = [*w, *v]
    momentum = system.momentum(system.state(state.q, u))
    of_centre = R @ v + np.cross(R @ w, found.centre - state.q[:3])
    linear = found.mass * of_centre
    angular = found.inertia @ R @ w + np.cross(found.centre, linear)
    np.testing.assert_allclose(momentum[3:], linear, atol=ROUNDING * np.linalg.norm(linear))
    np.testing.assert_allclose(momentum[:3], angular, atol=ROUNDING * np.linalg.norm(angular))


def test_a_cuboid_somewhere() -> None:
    """About its centre, in its own axes, about any point (Steiner); principal axes are right-handed."""
    J = cuboid_inertia(2.0, (1.0, 2.0, 3.0))
    centre = np.array([0.2, -0.1, 0.3])
    scene = (
        fm.SceneBuilder("cuboid")
        .rigid_body("block", mass=2.0, inertia=J, com=centre)
        .free("base", "ground", "block", position=(5.0, 6.0, 7.0), quaternion=(0.5, 0.5, 0.5, 0.5))
        .scene()
    )
    system = fm.compile(scene)
    found = system.mass_properties(system.initial_state, "block")
    assert found.mass == 2.0
    np.testing.assert_allclose(found.centre_in_body, centre, atol=1e-15)
    np.testing.assert_allclose(found.inertia_in_body, np.diag(np.diag(J)), atol=1e-14)
    np.testing.assert_allclose(found.origin, (5.0, 6.0, 7.0))
    arm = found.centre - np.array([1.0, 0.0, 0.0])
    steiner = found.inertia + 2.0 * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    np.testing.assert_allclose(found.about((1.0, 0.0, 0.0)), steiner, rtol=1e-13)
    moments, axes = found.principal
    np.testing.assert_allclose(moments, np.sort(np.diag(J)), rtol=1e-14)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_subtrees_add_up() -> None:
    """Hub, boom and arm with what each carries: the difference of two subtrees is the body between them."""
    system = fm.compile(spacecraft())
    state = bent(system)
    whole, boom, arm = (system.mass_properties(state, name) for name in ("hub", "boom", "arm"))
    assert whole.mass == pytest.approx(system.mass_properties(state).mass, rel=ROUNDING)
    assert boom.mass == pytest.approx(3.0 * 2700 * 2e-4 + 2.0 + arm.mass, rel=ROUNDING)
    assert arm.mass == pytest.approx(1.0 * 2700 * 2e-4, rel=ROUNDING)
    rest = whole.mass - boom.mass
    assert rest == pytest.approx(43.0, rel=ROUNDING)
    assert system.mass_properties(state, "slosh").mass == 3.0
    with pytest.raises(ValueError, match="there is no body 'wheel'|no body \"wheel\""):
        system.mass_properties(state, "wheel")


def test_far_from_the_origin() -> None:
    """An orbit's radius away nothing is lost but what the positions themselves have lost."""
    system = fm.compile(spacecraft())
    state = bent(system)
    near = system.mass_properties(state)
    state.q[:3] += 7e6
    far = system.mass_properties(state)
    np.testing.assert_allclose(far.inertia, near.inertia, atol=1e-7 * np.max(near.inertia))
