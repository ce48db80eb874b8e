"""The tree reader: order of bodies, rest frames of nodes, names of coordinates; frames A and B of closures and
connectors."""

import pytest

from flexmb.scene import schema as s
from flexmb.scene.tree import EndFrame, coordinates, ends, node_frame, node_names, ordered, rest_frames

UNIT = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def rigid(name: str, **more) -> s.RigidBody:
    return s.RigidBody(name=name, mass_kg=1.0, inertia_kg_m2=UNIT, **more)


def scene_of(*edges: tuple[str, str]) -> s.Scene:
    hinges = tuple(s.Revolute(name=f"{parent}-{child}", parent=parent, child=child) for parent, child in edges)
    names = sorted({child for _, child in edges})
    return s.Scene(name="tree", bodies=tuple(rigid(name) for name in names), hinges=hinges)


def test_depth_first_with_siblings_in_hinge_order():
    scene = scene_of(("b", "d"), ("ground", "c"), ("c", "b"), ("c", "a"), ("ground", "e"))
    assert [branch.body.name for branch in ordered(scene)] == ["c", "b", "d", "a", "e"]
    assert all(branch.hinge.child == branch.body.name for branch in ordered(scene))


@pytest.mark.parametrize(
    "edges",
    [(("a", "b"), ("b", "a")), (("ground", "a"), ("b", "a")), (("ground", "a"), ("ground", "a")), (("nobody", "a"),),
     (("ground", "a"), ("a", "b"), ("b", "a"))],
)  # fmt: skip
def test_not_a_tree_is_refused(edges):
    with pytest.raises(ValueError, match="check_scene"):
        ordered(scene_of(*edges))


def test_node_frames_of_every_kind():
    station = dict(EA_N=1.0, EIy_Nm2=1.0, EIz_Nm2=1.0, GJ_Nm2=1.0, mass_per_length_kg_m=1.0)
    turned = (0.0, 1.0, 0.0, 0.0)
    beam = s.BeamBody(
        name="beam", length_m=3.0, elements=2, modes=s.Modes(count=1),
        stations=(s.BeamStation(x_m=0.0, **station), s.BeamStation(x_m=3.0, **station)),
        nodes=(s.BeamNode(name="mid", x_m=1.5, quaternion=turned),),
    )  # fmt: skip
    assert rest_frames(beam).keys() == {"origin", "root", "tip", "mid"}
    assert node_frame(beam, "mid") == ((1.5, 0.0, 0.0), turned)
    assert node_frame(beam, "tip").position == (3.0, 0.0, 0.0)

    hub = rigid("hub", nodes=(s.Node(name="flange", position_m=(1.0, 2.0, 3.0), quaternion=turned),))
    assert node_frame(hub, "flange") == ((1.0, 2.0, 3.0), turned)
    assert node_frame(hub, "origin") == ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="flange"):
        node_frame(hub, "flnage")

    shape = ((1.0, 0.0, 0.0),)
    end = s.ModalNode(name="end", position_m=(1.0, 0.0, 0.0), translation_modes=shape, rotation_modes=shape)
    assert rest_frames(s.ModalBody(name="m", nodes=(end,))).keys() == {"origin", "end"}
    assert rest_frames(s.ModalBody(name="m", nodes=(end,), boundary="free-free")).keys() == {"end"}
    for body in (beam, hub, s.ModalBody(name="m", nodes=(end,)), s.ModalBody(name="f", boundary="free-free")):
        assert node_names(body) == tuple(rest_frames(body))
    with pytest.raises(ValueError, match="SID"):
        node_frame(s.SidBody(name="panel", file="panel.sid"), "origin")


def test_coordinates_carry_their_schema_keys():
    ends = dict(name="h", parent="ground", child="a")
    names = {
        s.Weld: [], s.Revolute: ["rotation"], s.Prismatic: ["translation"], s.Cylindrical: ["rotation", "translation"],
        s.Universal: ["first", "second"], s.Gimbal: ["rotations[0]", "rotations[1]", "rotations[2]"], s.Spherical: [],
        s.Planar: ["x", "y", "rotation"], s.Free: [],
    }  # fmt: skip
    for kind, expected in names.items():
        assert [coordinate.name for coordinate in coordinates(kind(**ends))] == expected
    mass = s.PointMass(name="bob", body="a", mass_kg=1.0, directions=((1.0, 0.0, 0.0),))
    assert coordinates(mass) == (("coordinates[0]", s.LinearCoordinate()),)


HALF_TURN = (0.0, 0.0, 0.0, 1.0)
SIDES = {"name": "c", "body_a": "ground", "body_b": "arm", "node_b": "tip", "position_b_m": (0.1, 0.2, 0.3)}


def test_ends_of_a_closure_have_their_own_axes() -> None:
    a, b = ends(s.Closure(type="weld", **SIDES, quaternion_a=HALF_TURN))
    assert a == EndFrame("ground", "origin", (0.0, 0.0, 0.0), HALF_TURN)
    assert b == EndFrame("arm", "tip", (0.1, 0.2, 0.3), (1.0, 0.0, 0.0, 0.0))


def test_ends_of_a_spring_have_the_axes_of_their_nodes() -> None:
    a, b = ends(s.SpringDamper(**SIDES, stiffness_N_m=1.0))
    assert (a.body, b.body, b.node) == ("ground", "arm", "tip")
    assert a.quaternion == b.quaternion == (1.0, 0.0, 0.0, 0.0)
