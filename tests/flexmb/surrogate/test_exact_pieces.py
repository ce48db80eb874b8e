"""Beams in pieces of level exact, curved ones too, and what other models of them are."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.testing import assert_allclose

import flexmb as fm
from flexmb.scene.strains import polynomials
from flexmb.surrogate import finite_segments, modal_points, rigidify, substructured
from flexmb.system.watches import WAIVERS

LENGTH = 2.0
SECTION = fm.BeamStation(
    x_m=0.0, EA_N=1e6, EIy_Nm2=2.0, EIz_Nm2=1.0, GJ_Nm2=0.8, mass_per_length_kg_m=0.4, rotary_y_kg_m=1e-3,
    rotary_z_kg_m=1e-3,
)  # fmt: skip
BENDING = ("bending_y",)
SPACE = ("torsion", "bending_y", "bending_z")


def loaded(
    modes: fm.Modes, force: tuple[float, float, float], level: str = "exact", curvature: float = 0.0
) -> fm.Scene:
    """A clamped beam, straight or an arc in its x-z plane, with a force on its tip and a node inside."""
    builder = fm.SceneBuilder("loaded")
    section = replace(SECTION, curvature_1_m=(0.0, curvature, 0.0))
    nodes = [fm.BeamNode(name="inside", x_m=1.3)]
    builder.beam("beam", length=LENGTH, elements=8, section=section, modes=modes, level=level, nodes=nodes)
    builder.weld("clamp", "ground", "beam").marker("tip", "beam", node="tip").marker("inside", "beam", node="inside")
    size = float(np.linalg.norm(force))
    along = tuple(np.array(force) / size)
    return builder.force("pull", "beam", node="tip", direction=along, function=fm.Constant(value=size)).scene()


def at_rest(scene: fm.Scene) -> np.ndarray:
    """Markers (2,3) at the equilibrium."""
    system = fm.compile(scene)
    found = fm.equilibrium(system)
    return np.array([marker.position for marker in system.evaluate(0.0, found.q, found.u).markers.values()])


@pytest.mark.parametrize(("count", "order"), [(1, 2), (2, 4), (3, 6)])
def test_pieces_converge_with_twice_the_power_of_their_polynomials(count: int, order: int) -> None:
    scene = loaded(fm.Modes(count=10, families=BENDING), (0.0, 0.5, 0.0))
    truth = at_rest(scene)
    tips = [at_rest(substructured(scene, "beam", n, polynomials=count))[0] for n in (2, 4)]
    coarse, fine = (np.linalg.norm(tip - truth[0]) for tip in tips)
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.7)


def test_pieces_of_a_stiffened_beam_have_three_polynomials_unless_told_otherwise() -> None:
    scene = loaded(fm.Modes(count=4, families=SPACE), (0.1, 0.3, 0.2), level="stiffened")
    chain = substructured(scene, None, 3, level="exact")
    assert [body.name for body in chain.bodies] == ["beam.p00", "beam.p01", "beam.p02"]
    assert all(body.level == "exact" and set(polynomials(body).values()) == {3} for body in chain.bodies)
    own = replace(scene, bodies=(replace(scene.bodies[0], level="exact", modes=fm.Modes(count=2, families=SPACE)),))
    assert all(body.modes.count == 2 for body in substructured(own, None, 2).bodies)
    chosen = fm.StrainPolynomials(bending_y=4, torsion=1)
    assert all(body.modes.polynomials == chosen for body in substructured(own, None, 2, polynomials=chosen).bodies)


@pytest.mark.parametrize("curvature", [0.0, 0.7], ids=["straight", "arc"])
def test_a_beam_and_its_pieces_bend_alike_in_space(curvature: float) -> None:
    scene = loaded(fm.Modes(count=9, families=SPACE), (0.3, 0.4, -0.5), curvature=curvature)
    chain = substructured(scene, "beam", 3, polynomials=5)
    fm.check_scene(chain)
    assert_allclose(at_rest(chain), at_rest(scene), atol=2e-6 * LENGTH)
    few = replace(substructured(scene, "beam", 2, polynomials=1), allow=WAIVERS)
    assert np.linalg.norm(at_rest(scene)[0] - at_rest(few)[0]) > 1e-3


def test_damping_is_that_of_a_material() -> None:
    """A straight beam of pieces has the first mode's frequency and damping, and so has one with that viscosity."""
    modes = fm.Modes(count=5, families=BENDING, damping_ratio=0.02)
    scene = replace(loaded(modes, (1.0, 0.0, 0.0)), loads=())
    first = fm.linearize(scene).modes[0]
    viscous = fm.Modes(count=5, families=BENDING, viscosity_s=2.0 * 0.02 / abs(first.eigenvalue))
    lagging = replace(scene, bodies=(replace(scene.bodies[0], modes=viscous),))
    for chain in (substructured(scene, None, 2), substructured(lagging, None, 2), lagging):
        assert fm.linearize(chain).modes[0].eigenvalue == pytest.approx(first.eigenvalue, rel=1e-6)


def test_a_curved_beam_is_rigid_along_its_arc() -> None:
    """Half a circle of radius R: its mass centre is 2 R / pi from the diameter, its inertia about the centre m R^2."""
    radius = LENGTH / np.pi
    scene = loaded(fm.Modes(count=3, families=BENDING), (1.0, 0.0, 0.0), curvature=1.0 / radius)
    thin = replace(scene.bodies[0], points="line")
    body = rigidify(replace(scene, bodies=(thin,))).bodies[0]
    assert isinstance(body, fm.RigidBody)
    centre = np.array([0.0, 0.0, -radius])
    assert_allclose(body.com_m, centre + [2.0 * radius / np.pi, 0.0, 0.0], atol=1e-12)
    mass = 0.4 * LENGTH
    about = mass * (radius**2 - (2.0 * radius / np.pi) ** 2)
    assert body.mass_kg == pytest.approx(mass) and body.inertia_kg_m2[1][1] == pytest.approx(about)
    tip = next(node for node in body.nodes if node.name == "tip")
    assert_allclose(tip.position_m, [0.0, 0.0, -2.0 * radius], atol=1e-12)


def test_refusals() -> None:
    scene = loaded(fm.Modes(count=3, families=SPACE), (1.0, 0.0, 0.0))
    arc = loaded(fm.Modes(count=3, families=SPACE), (1.0, 0.0, 0.0), curvature=0.5)
    with pytest.raises(ValueError, match=r"no eigenmodes; give polynomials=5"):
        substructured(scene, None, 2, eigenmodes=2)
    with pytest.raises(ValueError, match=r"only pieces of level \"exact\" have polynomials"):
        substructured(scene, None, 2, level="stiffened", polynomials=2)
    with pytest.raises(ValueError, match=r"curved at rest: its pieces need level \"exact\""):
        substructured(arc, None, 2, level="stiffened")
    with pytest.raises(ValueError, match="is curved: finite segments are for straight ones"):
        finite_segments(arc, None, 4)
    with pytest.raises(ValueError, match="do not move by modes"):
        modal_points(scene)
