"""Hinges and levels are what their files declare: every list follows, and a kind made up here moves as it should."""

from dataclasses import fields
from typing import get_args

import numpy as np
import pytest

from flexmb.building import assemble
from flexmb.dense import DenseSystem
from flexmb.entry import articulated
from flexmb.hinges import catalogue
from flexmb.hinges.kind import HingeKind, Reduced, scalar_hinge, z_to
from flexmb.jit.counting import count
from flexmb.jit.kernel import helper
from flexmb.jit.numbered import numbered
from flexmb.levels.body import LEVELS
from flexmb.scene import schema as s
from flexmb.scene.bodies import Level
from flexmb.scene.build import angular
from flexmb.scene.freedoms import ScalarFreedom
from flexmb.scene.hinges import Z_AXIS, _Hinge
from flexmb.scene.tree import coordinates
from flexmb.spatial.rotation import rotation_z
from flexmb.system.system import System
from flexmb.tables.arrays import ANGULAR_Z, LINEAR_Z
from flexmb.tables.features import HINGE
from tests import trees
from tests.bounds import backward_error, gamma

AXIS = (0.6, 0.0, 0.8)
POINTS = [
    s.PointMass(name="p", body="b", mass_kg=1.0, directions=tuple(map(tuple, np.eye(3)[:free]))) for free in range(4)
]
ENDS = {"name": "h", "parent": "ground", "child": "b"}
TWO_AXES = s.Gimbal(**ENDS, sequence="zy", rotations=(angular(), angular()))
ITEMS = [*(trees.bare(struct, **ENDS) for struct in get_args(s.Hinge)), TWO_AXES, *POINTS]


@pytest.mark.parametrize("item", ITEMS, ids=lambda item: type(item).__name__)
def test_every_hinge_of_the_schema_is_of_one_kind(item):
    """... which has as many initial values and names as coordinates and speeds."""
    [kind] = [kind for kind in catalogue.KINDS if kind.reduced(item) is not None]
    assert catalogue.kind_of(item)[0] is kind
    for pair in (kind.state(item), kind.names(item)):
        assert tuple(map(len, pair)) == (kind.coordinates, kind.speeds)


def test_every_kind_is_of_the_schema():
    assert {catalogue.kind_of(item)[0] for item in ITEMS} == set(catalogue.KINDS)
    assert len({kind.name for kind in catalogue.KINDS}) == len(catalogue.KINDS)


@pytest.mark.parametrize("kind", catalogue.KINDS, ids=lambda kind: kind.name)
def test_what_a_kind_says_of_its_speeds_is_true(kind):
    """Displacements have (m/s), a single axis is along z, and a quaternion has one coordinate more than speeds."""
    item = next(item for item in ITEMS if catalogue.kind_of(item)[0] is kind)
    units = [unit for _, unit in kind.names(item)[1]]
    assert [n for n, unit in enumerate(units) if unit == "m/s"] == list(kind.displacements)
    state, parameters = np.ones(8), np.full(3, 0.3)
    counted = count(kind.motion, state, 0, state, 0, np.array([0, 1, 2]), parameters, np.zeros((6, 6)))
    H = counted.arguments[-1].astype(float)
    rows = [row for row in (ANGULAR_Z, LINEAR_Z) if kind.speeds == 1 and np.array_equal(H[:, 0], np.eye(6)[row])]
    assert rows == ([kind.axis] if kind.axis >= 0 else [])
    assert (kind.quaternion >= 0) == (kind.coordinates == kind.speeds + 1)


@pytest.mark.parametrize("item", ITEMS, ids=lambda item: type(item).__name__)
def test_freedoms_have_the_coordinates_of_the_kind(item):
    """As many coordinates and speeds as the kernels have, under the same names in the same order."""
    kind = catalogue.kind_of(item)[0]
    sizes = [freedom.sizes for freedom in item.freedoms]
    assert (sum(q for q, _ in sizes), sum(u for _, u in sizes)) == (kind.coordinates, kind.speeds)
    scalars = [(freedom.name, freedom.coordinate) for freedom in item.freedoms if isinstance(freedom, ScalarFreedom)]
    assert scalars == list(coordinates(item))


def test_levels_are_those_of_the_schema():
    assert tuple(level.name for level in LEVELS) == get_args(Level)


def test_a_thing_of_no_kind_is_refused():
    with pytest.raises(TypeError, match="no kind of flexmb.hinges takes a Drill: h"):
        catalogue.kind_of(Drill(**ENDS))


PITCH = 0.3  # m/rad


class Drill(_Hinge, frozen=True, kw_only=True, tag="drill"):
    """Rotation about `axis`, and PITCH times as much translation along it."""

    axis: s.Vector = Z_AXIS
    rotation: s.AngularCoordinate = s.AngularCoordinate()

    @property
    def freedoms(self) -> tuple[ScalarFreedom, ...]:
        return (ScalarFreedom("rotation", self.axis, self.rotation, PITCH),)


@helper
def pose(q, i, sequence, parameters):
    return rotation_z(q[i]), (0.0, 0.0, PITCH * q[i])


@helper
def motion(q, i, u, j, sequence, parameters, H):
    H[2, 0] = 1.0
    H[5, 0] = PITCH
    zero = (0.0, 0.0, 0.0)
    return ((0.0, 0.0, u[j]), (0.0, 0.0, PITCH * u[j])), (zero, zero)


def reduced(item) -> Reduced | None:
    return Reduced(turn=z_to(item.axis)) if isinstance(item, Drill) else None


DRILL = scalar_hinge("drill", 1, pose=pose, motion=motion, reduced=reduced)


@pytest.fixture
def with_drill(monkeypatch):
    """A catalogue of one more kind; the dense route and all else follow from its freedoms."""
    kinds = (*catalogue.KINDS, DRILL)
    for room in (catalogue, assemble):
        monkeypatch.setattr(room, "KINDS", kinds)
    for name in ("pose", "motion", "rate", "retract", "resolve"):
        monkeypatch.setattr(catalogue, name, numbered(name, HINGE, [getattr(kind, name) for kind in kinds]))


def drilled(bodies: int = 4) -> s.Scene:
    """A random tree whose last hinges are drills."""
    scene = trees.random_scene(3, trees.Recipe(bodies=bodies, carriers=("rigid", "modal"), wheels=1, point_masses=1))
    place = [key for key in _Hinge.__struct_fields__]
    drills = [
        Drill(
            **{key: getattr(hinge, key) for key in place}, axis=AXIS,
            rotation=angular(angle=0.4, rate=1.5, stiffness=3.0, damping=0.2),
        )
        for hinge in scene.hinges[1:]
    ]  # fmt: skip
    return s.Scene(
        **{key: getattr(scene, key) for key in scene.__struct_fields__ if key != "hinges"},
        hinges=(scene.hinges[0], *drills),
    )  # fmt: skip


def test_a_made_up_hinge_needs_its_declaration_only(with_drill):
    """Tables, numbering, dispatch and initial state follow; the accelerations solve the dense equations."""
    scene = drilled()
    system, dense = System(scene), DenseSystem(scene)
    q, u = np.zeros(system.nq), np.zeros(system.nu)
    for link in system.links:
        q[system.coordinate(link.hinge.name)], u[system.speed(link.hinge.name)] = link.kind.state(link.hinge)
    q, u = dense.on_profile(q, u, 0.0)
    assert sum(body["hinge_kind"] == len(catalogue.KINDS) - 1 for body in system.constants.body) == 3
    y = np.concatenate([q, u, [0.0]])
    counted = count(articulated.accelerations, 0.0, y, system.constants, system.workspace())
    rates = np.array([float(speed.acceleration) for speed in counted.arguments[3].speed])
    free = np.ones(dense.nu, dtype=bool)
    free[[x.u for x in dense.tree.scalars if x.prescribed is not None]] = False
    right = dense.applied(q, u) - dense.bias(q, u)
    assert backward_error(dense.mass_matrix(q)[free], rates, right[free]) <= gamma(dense.nu)


def test_a_declaration_has_no_field_that_nobody_reads():
    """Every field of HingeKind differs between kinds: one that is always its default is not needed."""
    for field in fields(HingeKind):
        assert len({str(getattr(kind, field.name)) for kind in catalogue.KINDS}) > 1, field.name
