"""What each defect of the print costs in one scene, against the recursion at level full: the figures of docs/errata.md.

A spinning hub carries an arm with turning elements; on nodes of the arm that deform sit a second arm and a fast wheel;
gravity acts, and a force at a node. eps is the size of modal coordinates and rates. The cost is the generalised force
that the accelerations miss, M (udot - udot_full), in units of the inertia forces |M| |udot_full|, largest component.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from numpy.random import Generator

import flexmb
from flexmb.frisch.errata import AS_PRINTED, CORRECTED, Erratum
from flexmb.frisch.nested_system import nested_system
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.modal_data import inertia_points
from tests import trees
from tests.repo.project import ROOT

EPS = (1e-1, 1e-2, 1e-3)
# At each eps; the order in eps of every defect is held in test_errata.py.
COSTS = {
    "corrected": (2.1e-3, 3.5e-5, 2.8e-7),
    "INERTIA_SLOPE": (2.3e-3, 5.1e-5, 8.8e-6),
    "ROTARY_CORIOLIS": (2.1e-3, 3.5e-5, 2.9e-6),
    "DROPPED_DEFORMATION": (9.8e-3, 1.2e-3, 5.6e-5),
    "SECOND_ORDER": (1.9e-3, 3.1e-5, 2.5e-7),
    "FIXED_SHAPES": (1.2e-2, 8.0e-4, 4.8e-5),
    "FIXED_SPIN_AXIS": (2.4e-3, 3.1e-4, 3.4e-5),
    "NO_LOADS_ON_MODES": (1.2e-2, 9.3e-2, 1.1e-1),
    "ONE_SIDED": (2.9e-1, 2.5e-1, 7.8e-2),
    "as printed": (2.3e-1, 9.2e-2, 2.9e-1),
}


def arm(scene: SceneBuilder, rng: Generator, name: str, eps: float) -> None:
    """Five elements of anisotropic inertia and three assumed modes of order one, clamped at the origin."""
    masses = rng.uniform(0.1, 0.4, 5)
    points = inertia_points(
        masses, rng.uniform(-0.6, 0.6, (5, 3)), rng.uniform(-1.0, 1.0, (5, 3, 3)),
        rotation_modes=rng.uniform(-2.0, 2.0, (5, 3, 3)),
        inertia=np.array([trees.inertia(rng, m, 0.6) for m in masses]),
    )  # fmt: skip
    nodes = [
        s.ModalNode(
            name=node, position_m=tuple(trees.vector(rng, 0.5)),
            translation_modes=trees.matrix(rng.uniform(-1.0, 1.0, (3, 3))),
            rotation_modes=trees.matrix(rng.uniform(-2.0, 2.0, (3, 3))),
        )
        for node in ("a", "b")
    ]  # fmt: skip
    root = rng.normal(size=(3, 3))
    stiffness = 300.0 * (root @ root.T + np.eye(3))
    scene.modal_body(name, points=points, stiffness=stiffness, damping=np.zeros((3, 3)), boundary="clamped-free",
                     level="full", nodes=nodes)  # fmt: skip
    scene.modal_state(name, coordinates=eps * rng.uniform(-1, 1, 3), rates=eps * rng.uniform(-1, 1, 3))


def spacecraft(eps: float) -> flexmb.System:
    """Hub, arm, second arm, wheel."""
    rng = np.random.default_rng(0)
    scene = SceneBuilder("arm on arm", gravity=(0.0, 0.0, -9.81))
    scene.rigid_body("hub", mass=2.0, inertia=(0.2, 0.3, 0.4), com=(0.05, 0.0, 0.02), nodes={"side": (0.3, 0.1, 0.0)})
    scene.free("base", "ground", "hub", angular_velocity=(1.0, -0.7, 1.5), velocity=(0.1, 0.2, 0.3))
    arm(scene, rng, "arm", eps)
    scene.spherical("root", "hub", "arm", parent_node="side", angular_velocity=trees.vector(rng, 2.0))
    arm(scene, rng, "second", eps)
    scene.spherical("elbow", "arm", "second", parent_node="a", angular_velocity=trees.vector(rng, 2.0))
    push = s.Sine(amplitude=3.0, angular_frequency_rad_s=1.0, phase_rad=1.0)
    scene.force("push", "second", node="b", direction=(0.0, 1.0, 0.0), function=push)
    scene.wheel("wheel", "arm", node="b", axis=trees.direction(rng), mass=0.3, axial_inertia=0.02,
                transverse_inertia=0.012, speed=60.0)  # fmt: skip
    return flexmb.compile(scene.scene())


def _packed(state: flexmb.State) -> np.ndarray:
    return np.concatenate([state.q, state.u, [0.0]])


@pytest.fixture(scope="module")
def systems() -> list[flexmb.System]:
    return [spacecraft(eps) for eps in EPS]


@pytest.mark.parametrize("name", COSTS)
def test_cost(systems, name):
    """(52), (72), (64), (96), (98), (118), (121), (131), (134), (110), (136), each alone, and all."""
    whole = {"corrected": CORRECTED, "as printed": AS_PRINTED}
    errata = whole[name] if name in whole else frozenset([Erratum[name]])
    costs = []
    for system in systems:
        state = system.initial_state
        M, true = system.mass_matrix(state), system.accelerations(state)
        status, found = nested_system(system.scene, errata).accelerations(0.0, _packed(state))
        assert status == 0
        costs.append(np.max(np.abs(M @ (found - true))) / np.max(np.abs(M) @ np.abs(true)))
    assert costs == pytest.approx(COSTS[name], rel=0.05)


def test_one_sided_matrix_is_unsymmetric(systems):
    """(136): |M - M'| / |M|, Frobenius."""
    system = systems[1]
    M, _ = nested_system(system.scene, frozenset([Erratum.ONE_SIDED])).reduced(0.0, _packed(system.initial_state))
    assert np.linalg.norm(M - M.T) / np.linalg.norm(M) == pytest.approx(0.459, rel=0.01)


def test_the_page_of_errata_has_these_figures():
    text = (ROOT / "docs" / "errata.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `?([\w ]+?)`? \| ([\de.-]+) \| ([\de.-]+) \| ([\de.-]+) \|$", text, flags=re.MULTILINE)
    assert {name: tuple(map(float, figures)) for name, *figures in rows} == COSTS
