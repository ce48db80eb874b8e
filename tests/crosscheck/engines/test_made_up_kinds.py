"""A kind that was made up here: what follows from its freedoms knows it, everything else refuses it by name."""

from typing import Any

import msgspec
import numpy as np
import pytest

from crosscheck.engines.connections import KNOWN, _along, exerts
from crosscheck.engines.links import freedoms, obstacle
from crosscheck.library.mutations.mirror import _hinge as is_own_image
from crosscheck.library.mutations.turning import _own as axis_of
from crosscheck.mutation.invariances.counterpart import NotApplicable
from crosscheck.mutation.invariances.mirrored import MIRRORED
from crosscheck.mutation.invariances.units import _without_unit
from flexmb.dense.connectors import grip
from flexmb.dense.hinge_frames import hinge_frame
from flexmb.dense.jets import Jet, MovingFrame, constant
from flexmb.scene import schema as s
from flexmb.scene.bodies import SceneStruct
from flexmb.scene.check.outboard import _free_directions
from flexmb.scene.freedoms import Freedom, ScalarFreedom
from flexmb.scene.hinges import _Hinge

ENDS = {"name": "joint", "parent": "ground", "child": "arm"}
X, Z = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


class Boring(_Hinge, frozen=True, kw_only=True, tag="boring"):
    """Drives forward along z while it turns, then slides along the carried x."""

    rotation: s.AngularCoordinate = s.AngularCoordinate()
    x: s.LinearCoordinate = s.LinearCoordinate()

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        return ScalarFreedom("rotation", Z, self.rotation, 0.5), ScalarFreedom("x", X, self.x)


def _directions(hinge: Any) -> Any:
    return _free_directions([hinge.freedoms])


class Silent(_Hinge, frozen=True, kw_only=True, tag="silent"):
    """Does not say which freedoms it has."""


class MadeUp(SceneStruct, frozen=True, kw_only=True, tag_field="kind", tag="made_up"):
    """A connector of no kind."""

    name: str = "odd"
    strength: float = 1.0


BORING = Boring(**ENDS, rotation=s.AngularCoordinate(angle_rad=0.5), x=s.LinearCoordinate(position_m=2.0))


def test_directions_follow_from_freedoms() -> None:
    """The turn moves the point that has slid out by 2 m at 2 m per radian, across; the drive moves it along z."""
    assert _free_directions([BORING.freedoms])[0] == pytest.approx(np.array([[0, 0, 1, 0, 2, 0.5], [0, 0, 0, 1, 0, 0]]))


def test_dense_frames_follow_from_freedoms() -> None:
    q, u = np.array([0.5, 2.0]), np.array([3.0, 0.0])
    frame = hinge_frame(BORING, Jet(q[None, None], u[None, None], np.zeros((1, 1, 2))))
    c, sine = np.cos(0.5), np.sin(0.5)
    assert frame.position.value[0, 0] == pytest.approx([2.0 * c, 2.0 * sine, 0.25])
    assert frame.position.rate[0, 0] == pytest.approx([-6.0 * sine, 6.0 * c, 1.5])
    assert frame.angular_velocity()[0, 0] == pytest.approx([0.0, 0.0, 3.0])


def test_joints_of_peers_follow_from_freedoms() -> None:
    assert [(freedom.motion, freedom.pitch) for freedom in freedoms(BORING)] == [("screw", 0.5), ("slide", 0.0)]
    scene = s.Scene(name="odd", bodies=(), hinges=(BORING,))
    assert obstacle(scene, "Anything", ()) == 'hinge "joint" is a screw: the adapter of Anything offers no such joint'
    assert obstacle(scene, "Anything", (), screws=True) == ""


def test_rules_of_mutations_follow_from_freedoms() -> None:
    assert axis_of(BORING) == pytest.approx(np.array(Z))
    assert not any(is_own_image(BORING, axis) for axis in range(3))


@pytest.mark.parametrize("use", [_directions, freedoms], ids=["directions", "joints"])
def test_a_hinge_that_does_not_say_its_freedoms_is_refused_by_name(use: Any) -> None:
    with pytest.raises(NotImplementedError, match='hinge "joint": Silent does not say which freedoms it has'):
        use(Silent(**ENDS))


STILL = MovingFrame(constant(np.zeros(3)), constant(np.eye(3)))


@pytest.mark.parametrize(
    "use",
    [exerts, _along, lambda odd: grip(odd, STILL, STILL, 0.0)],
    ids=["peers, between nodes", "peers, along a hinge", "dense route"],
)
def test_a_made_up_connector_is_refused_by_name(use: Any) -> None:
    with pytest.raises(AssertionError, match=r"MadeUp\(name='odd', strength=1.0\)"):
        use(MadeUp())


def test_adapters_refuse_a_made_up_connector() -> None:
    odd = msgspec.structs.replace(s.Scene(name="odd", bodies=(), hinges=()), connectors=(MadeUp(),))
    assert obstacle(odd, "Anything", (), KNOWN) == 'connector "odd": the adapter of Anything has none of its kind'
    assert not isinstance(MadeUp(), KNOWN)


def test_a_number_whose_unit_nobody_says_is_not_put_in_other_units() -> None:
    with pytest.raises(NotApplicable, match='connector "odd": nobody says the unit of "strength"'):
        _without_unit(MadeUp(), "strength")


def test_a_hand_that_no_key_changes_has_no_counterpart_in_the_mirror() -> None:
    body = s.RigidBody(name="arm", mass_kg=1.0, inertia_kg_m2=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), Z))
    with pytest.raises(NotApplicable, match='hinge "joint" has a hand, and no key that changes it'):
        MIRRORED.of(s.Scene(name="odd", bodies=(body,), hinges=(BORING,)))
