"""Laws of connectors are what their files declare; what derivatives cannot go through is said when they are."""

import math
from math import exp
from typing import get_args

import pytest

from flexmb.connectors import catalogue
from flexmb.connectors.law import MOST, CoordinateLaw, LawError
from flexmb.jit.kernel import helper
from flexmb.jit.lanes import select
from flexmb.scene import schema as s
from flexmb.scene.bodies import SceneStruct
from flexmb.scene.connectors import BetweenNodes, HingeFriction, HingeSpring
from flexmb.spatial.scalar import sqrt
from flexmb.tables.arrays import COORDINATE_LAW, FRAME_LAW

FRICTION = s.AngularFriction(name="f", hinge="h", sliding_Nm=2.0, smoothing_rad_s=1e-3)


class MadeUp(SceneStruct, frozen=True, kw_only=True, tag_field="kind", tag="made_up"):
    """A connector of no kind."""

    name: str = "odd"


def test_every_connector_along_a_coordinate_is_a_spring_or_of_one_law():
    kinds = set(get_args(s.Connector)) - {s.SpringDamper, s.Bushing} - set(get_args(HingeSpring))
    assert kinds == set(get_args(HingeFriction))
    number, parameters = catalogue.law_of(FRICTION)
    assert catalogue.LAWS[number].name == "friction"
    assert parameters == (2.0, 2.0, 1.0, 1e-3)
    assert len(parameters) <= MOST


def test_every_connector_between_frames_is_of_one_law():
    ends = {"name": "c", "body_a": "ground", "body_b": "b"}
    spring = s.SpringDamper(**ends, stiffness_N_m=1.0)
    rows = tuple(tuple(float(6 * i + j) for j in range(6)) for i in range(6))
    bushing = s.Bushing(**ends, stiffness=rows, damping=rows)
    assert {type(each) for each in (spring, bushing)} == set(get_args(BetweenNodes))
    assert len(catalogue.FRAME_LAWS) == 2
    assert catalogue.frame_law_of(spring) == (0, ())
    assert catalogue.frame_law_of(bushing) == (1, (*range(36), *range(36)))


def test_a_law_has_no_more_parameters_than_the_table_has_room_for():
    assert FRAME_LAW["parameters"].shape == (72,)
    assert COORDINATE_LAW["parameters"].shape == (MOST,)


@pytest.mark.parametrize("law_of", [catalogue.law_of, catalogue.frame_law_of], ids=["along a coordinate", "between"])
def test_a_connector_of_no_law_is_refused_by_name(law_of):
    with pytest.raises(TypeError, match="no law of flexmb.connectors takes a MadeUp: odd"):
        law_of(MadeUp())


@helper
def compares(parameters, q, v):
    resisting = parameters[0] * v
    if v > 0.0:
        resisting = 2.0 * resisting
    return -resisting, 0.0 * v, -resisting * v


@helper
def takes_an_exponential(parameters, q, v):
    return -exp(v), 0.0 * v, 0.0 * v


@helper
def reaches_into_a_module(parameters, q, v):
    return -math.exp(v), 0.0 * v, 0.0 * v


@helper
def stores_nothing(parameters, q, v):
    return -v, 0.0, 0.0 * v


@helper
def takes_a_root(parameters, q, v):
    return -(v**1.5), 0.0 * v, 0.0 * v


@helper
def takes_a_size(parameters, q, v):
    return -abs(v) * v, 0.0 * v, 0.0 * v


@helper
def chooses_by_truth(parameters, q, v):
    return -v if v else 0.0, 0.0 * v, 0.0 * v


@helper
def forgets_the_power(parameters, q, v):
    return -v, 0.0 * v


@helper
def knows_how(parameters, q, v):
    pushed = select(q.real > parameters[0], q - parameters[0], 0.0 * q)
    return -pushed * sqrt(1.0 + v * v), 0.5 * pushed * pushed, 0.0 * v


@pytest.mark.parametrize(
    ("kernel", "said"),
    [
        (compares, r"is compared: compare x.real, and take select\(\)\n  .*_laws.py, line \d+: if v > 0.0"),
        (takes_an_exponential, r"derivatives are not carried through math.exp\(\)\n  .*line \d+: return -exp"),
        (reaches_into_a_module, r"its load has lost the derivatives: take functions from flexmb.spatial.scalar"),
        (stores_nothing, r"its energy has lost the derivatives: .*0.0 \* v"),
        (takes_a_root, r"only squares are powers .*\n  .*line \d+: return -\(v\*\*1.5\)"),
        (takes_a_size, r"abs\(\) has no derivative at zero"),
        (chooses_by_truth, r"is compared: compare x.real"),
        (forgets_the_power, r"return the load, the energy and the power"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_what_derivatives_cannot_go_through_is_said_in_the_law_s_own_words(kernel, said):
    """At once, and not by the compiler when somebody linearises."""
    with pytest.raises(LawError, match=f'law "odd".*{said}'):
        CoordinateLaw("odd", kernel, lambda connector: None)


def test_a_law_that_knows_how_is_taken():
    assert CoordinateLaw("stop", knows_how, lambda connector: None).name == "stop"
