"""The builder writes the schema's structs; helpers give the numbers of textbooks."""

import doctest
import inspect
from typing import Unpack, get_args, get_origin, get_type_hints

import numpy as np
import pytest

from flexmb.scene import build, methods
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder, angular
from flexmb.scene.collecting import COLLECTIONS
from flexmb.scene.connectors import NONE6
from flexmb.scene.keys import split_unit
from flexmb.scene.problems import SceneError
from flexmb.scene.shapes import beam_section, cuboid_inertia, cylinder_inertia, inertia_moments
from tests.repo import builder

UNIT = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def test_the_builder_writes_the_structs():
    built = (
        SceneBuilder("pendulum", gravity=np.array([0, 0, -9.81]), description="a rod")
        .rigid_body("arm", mass=1, com=[0.5, 0, 0], inertia=np.eye(3), nodes={"end": (1, 0, 0)})
        .revolute("pivot", "ground", "arm", axis=(0, 1, 0), angle=0.3, torque=s.Constant(value=2), child_node="end")
        .marker("tip", "arm", offset=(1, 0, 0))
        .scene()
    )
    node = s.Node(name="end", position_m=(1.0, 0.0, 0.0))
    pivot = s.Revolute(
        name="pivot", parent="ground", child="arm", child_node="end", axis=(0.0, 1.0, 0.0),
        rotation=s.AngularCoordinate(angle_rad=0.3, torque_Nm=s.Constant(value=2.0)),
    )  # fmt: skip
    assert built == s.Scene(
        name="pendulum", description="a rod", gravity_m_s2=(0.0, 0.0, -9.81), hinges=(pivot,),
        bodies=(s.RigidBody(name="arm", mass_kg=1.0, com_m=(0.5, 0.0, 0.0), inertia_kg_m2=UNIT, nodes=(node,)),),
        markers=(s.Marker(name="tip", body="arm", offset_m=(1.0, 0.0, 0.0)),),
    )  # fmt: skip
    assert all(isinstance(number, float) for number in built.bodies[0].com_m)


def test_the_example_in_the_documentation_runs():
    assert doctest.testmod(build).failed == 0


METHODS = builder.METHODS | {
    "rigid_body": s.RigidBody, "beam": s.BeamBody, "gimbal": s.Gimbal, "coupling": s.Coupling, "force": s.Load,
    "torque": s.Load, "event": s.SceneEvent, "user_law": s.UserLaw,
}  # fmt: skip
# Keys that a method says in its own way: the section of a beam, the one coordinate of a hinge, the type of a load,
# the terms of a coupling.
REPLACED = {"beam": {"stations"}, "revolute": {"rotation"}, "screw": {"rotation"}, "prismatic": {"translation"},
            "force": {"type"}, "torque": {"type"}, "coupling": {"terms"}}  # fmt: skip


def test_every_kind_has_a_method():
    assert set(METHODS.values()) == set(COLLECTIONS)


@pytest.mark.parametrize("method", METHODS)
def test_every_key_of_the_schema_is_an_argument(method):
    """By name and without unit; what is gathered is typed by a dictionary of `flexmb.scene.collecting`."""
    function = getattr(SceneBuilder, method)
    arguments = set(inspect.signature(function).parameters)
    for hint in get_type_hints(function).values():
        if get_origin(hint) is Unpack:
            arguments |= set(get_args(hint)[0].__annotations__)
    keys = {split_unit(key)[0] for key in METHODS[method].__struct_fields__}
    assert keys - arguments == REPLACED.get(method, set())


def test_generated_methods_are_those_of_the_schema():
    assert inspect.getsource(methods) == builder.text(), "run: python -m tests.repo.builder"


def test_what_is_none_is_not_given():
    body = SceneBuilder("x").rigid_body("a", mass=1.0, inertia=UNIT).free("h", "ground", "a")
    (bushing,) = body.bushing("b", "a", "ground", stiffness=np.eye(6), damping=None).scene().connectors
    assert bushing.damping == NONE6


def test_structs_can_be_added_as_they_are():
    body = s.RigidBody(name="a", mass_kg=1.0, inertia_kg_m2=UNIT)
    scene = SceneBuilder("x").add(body, s.Free(name="h", parent="ground", child="a")).scene()
    assert scene.bodies == (body,)
    with pytest.raises(TypeError, match="Node is not a part of a scene by itself"):
        SceneBuilder("x").add(s.Node(name="n"))


def test_wrong_arguments_are_named():
    with pytest.raises(TypeError, match=r'weld\(\) has no argument "parent_nod": did you mean "parent_node"'):
        SceneBuilder("x").weld("h", "ground", "a", parent_nod="tip")
    with pytest.raises(TypeError, match='did you mean "stiffness"'):
        angular(stifness=1.0)
    with pytest.raises(TypeError, match=r'revolute\(\) has no argument "stifness": did you mean "stiffness"'):
        SceneBuilder("x").revolute("h", "ground", "a", stifness=1.0)
    with pytest.raises(TypeError, match=r'prismatic\(\) has no argument "torque": '):
        SceneBuilder("x").prismatic("h", "ground", "a", torque=s.Constant(value=1.0))
    with pytest.raises(TypeError, match=r'closure\(\) has no argument "node_c"'):
        SceneBuilder("x").closure("c", "weld", "a", "b", node_c="tip")
    with pytest.raises(TypeError, match='a beam section has no "shear_facto": did you mean "shear_factor"'):
        beam_section(E=1.0, G=1.0, A=1.0, Iy=1.0, Iz=1.0, rho=1.0, shear_facto=0.9)
    with pytest.raises(SceneError, match=r'\$\.bodies\[0\]\.mass_kg \(body "a"\): Expected `float`, got `str`'):
        SceneBuilder("x").rigid_body("a", mass="1", inertia=UNIT)


def test_a_uniform_beam_has_its_section_at_both_ends():
    section = beam_section(E=200e9, G=80e9, A=1e-4, Iy=2e-9, Iz=3e-9, rho=7800.0)
    builder = SceneBuilder("x").beam("boom", length=2.0, elements=4, section=section, modes=2, nodes={"mid": 1.0})
    (beam,) = builder.free("h", "ground", "boom").scene().bodies
    assert [station.x_m for station in beam.stations] == [0.0, 2.0]
    assert beam.stations[1].EIz_Nm2 == 200e9 * 3e-9
    assert beam.modes.count == 2
    assert beam.nodes == (s.BeamNode(name="mid", x_m=1.0),)


def test_inertia_helpers_against_sums_over_points():
    """Midpoint sums over n cells in each direction miss 1/n^2 of a moment: the tensor of one cell."""
    n, size, mass = 20, np.array([1.0, 2.0, 3.0]), 6.0
    axes = [(np.arange(n) + 0.5) / n * edge - edge / 2 for edge in size]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    tensor = mass * (np.mean(points**2) * 3 * np.eye(3) - points.T @ points / len(points))
    np.testing.assert_allclose(cuboid_inertia(mass, tuple(size)), tensor, rtol=1.01 / n**2, atol=1e-12)

    radius, length = 0.5, 3.0
    disc = points[:, :2] / size[:2] * 2 * radius
    inside = np.hypot(*disc.T) < radius
    x, y = disc[inside].T
    z = points[inside, 2] / size[2] * length
    axial, transverse = mass * np.mean(x**2 + y**2), mass * np.mean(y**2 + z**2)
    expected = np.diag([axial, transverse, transverse])
    # a disc cut from an n x n grid is round to its cell: 1/n of its area
    np.testing.assert_allclose(cylinder_inertia(mass, radius, length, "x"), expected, rtol=1.0 / n, atol=1e-12)
    np.testing.assert_array_equal(inertia_moments(1, 2, 3, 4, 5, 6), [[1, 4, 5], [4, 2, 6], [5, 6, 3]])


def test_numbers_of_extended_precision_are_rounded_and_complex_ones_refused():
    def scene(mass, inertia):
        return SceneBuilder("one").rigid_body("hub", mass=mass, inertia=inertia).revolute("h", "ground", "hub").scene()

    third = np.longdouble(1) / 3
    assert scene(third, np.array([third] * 3)) == scene(float(third), [float(third)] * 3)
    for wrong in (np.clongdouble(1.0), np.array([1j] * 3)):
        with pytest.raises(TypeError, match="cannot hold a c"):
            scene(1.0, wrong)
