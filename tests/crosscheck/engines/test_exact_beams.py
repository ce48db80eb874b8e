"""Beams of level exact in engines: who takes them, who refuses them and says what to do, and how they are refined."""

import numpy as np
import pytest
from msgspec.structs import replace

from crosscheck.engines.contract import Run
from crosscheck.engines.registry import BUILT_IN, OWN_CODE, engine
from crosscheck.library.case import Refined, Variant
from crosscheck.running.plan import variant_scene
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.check import check_scene
from flexmb.scene.functions import Constant
from flexmb.scene.strains import polynomials
from tests.crosscheck.engines.peers import installed

LENGTH, WEIGHT = 1.0, 0.5  # m, kg/m


def strip(gravity: float = 0.0, curvature: float = 0.0, **modes: object) -> s.Scene:
    root = s.BeamStation(
        x_m=0.0, EA_N=1e5, EIy_Nm2=2.0, EIz_Nm2=2.0, GJ_Nm2=1.5, mass_per_length_kg_m=WEIGHT, rotary_y_kg_m=1e-6,
        rotary_z_kg_m=1e-6, curvature_1_m=(0.0, 0.0, curvature),
    )  # fmt: skip
    given = {"count": 4, "families": ("bending_y",)} | modes
    return (
        SceneBuilder("strip", gravity=(0.0, gravity, 0.0))
        .beam("strip", length=LENGTH, elements=16, section=[root, replace(root, x_m=LENGTH)], modes=s.Modes(**given),
              level="exact")
        .weld("clamp", "ground", "strip")
        .force("pull", "strip", node="tip", direction=(0.0, 1.0, 0.0), function=Constant(value=1.0))
        .marker("tip", "strip", node="tip")
        .scene()
    )  # fmt: skip


@pytest.mark.parametrize("name", [name for name in BUILT_IN if name not in (*OWN_CODE, "exudyn-beam")])
def test_engines_of_rigid_bodies_and_of_modes_refuse_it_with_the_remedy(name: str) -> None:
    support = installed(name).supports(strip())
    assert support.kind == "no"
    assert '"strip"' in support.reason
    assert "exudyn-beam" in support.reason or "finite-segment" in support.reason


@pytest.mark.parametrize(
    ("scene", "what"), [(strip(viscosity_s=1e-3), "rate of strain"), (strip(damping_ratio=0.01), "modal damping")]
)
def test_exudyns_beams_refuse_what_they_have_not(scene: s.Scene, what: str) -> None:
    check_scene(scene)
    support = engine("exudyn-beam").supports(scene)
    assert support.kind == "no"
    assert what in support.reason


@pytest.mark.parametrize(
    "scene",
    [
        strip(polynomials=s.StrainPolynomials(bending_y=3, torsion=2)),
        strip(curvature=0.3),
        replace(strip(), gravity_m_s2=(0.0, 0.0, -1.0)),
    ],
)
def test_what_exudyns_planar_beam_has_not_its_beams_in_space_have(scene: s.Scene) -> None:
    check_scene(scene)
    support = engine("exudyn-beam").supports(scene)
    assert support.kind == "surrogate"
    assert "strip: shear as stiff as stretch" in support.reason


@pytest.mark.parametrize("axial", [0, 1])
def test_exudyns_planar_beam_hangs_and_swings_as_the_exact_one(axial: int) -> None:
    """Under a tip force and its weight, two thirds of the length deep: gravity on cable elements is there, to 1e-3."""
    pytest.importorskip("exudyn", reason="Exudyn is not installed: pip install flexmb[peers]")
    scene = strip(gravity=-9.81, polynomials=s.StrainPolynomials(bending_y=4, axial=axial))
    times = np.linspace(0.0, 0.5, 26)
    tips = []
    for name in ("native", "exudyn-beam"):
        code = engine(name)
        assert code.supports(scene).kind == ("exact" if name == "native" else "surrogate")
        effort = code.efforts_for(scene, 0.5)[1]
        done = code.compile(scene).simulate(Run(times), effort)
        assert done.status == "finished"
        tips.append(done.markers["tip"].position)
    assert np.linalg.norm(tips[0] - tips[1], axis=1).max() < 2e-3 < 0.1 < np.ptp(tips[0][:, 1])


def test_a_variant_is_refined_by_more_polynomials_of_each_strain() -> None:
    variant = Variant(name="exact", engines=("native",), refined=Refined(polynomials=2))
    scene = strip(polynomials=s.StrainPolynomials(bending_y=3, axial=1), points=9)
    (coarse,), (fine,) = (variant_scene(scene, variant, each).bodies for each in (None, variant.refined))
    assert polynomials(coarse) == {"axial": 1, "bending_y": 3}
    assert polynomials(fine) == {"axial": 3, "bending_y": 5}
    assert (coarse.modes.points, fine.modes.points) == (9, 11)
    (stiffened,) = variant_scene(scene, Variant(name="x", engines=("native",), level="full"), variant.refined).bodies
    assert stiffened.modes == scene.bodies[0].modes


def test_figures_accepted_without_polynomials_keep_their_basis() -> None:
    """Accepted figures name what they belong to by this text."""
    assert str(Refined(pieces=3)) == "Refined(segments=None, pieces=3, elements=None, order=2.0)"
    assert "polynomials=1" in str(Refined(polynomials=1))
