"""Frames A and B of closures and connectors, whether or not these give them axes."""

from flexmb.scene import schema as s
from flexmb.scene.ends import EndFrame, ends

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
