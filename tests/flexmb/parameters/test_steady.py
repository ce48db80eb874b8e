"""Derivatives of tables that are kept when numbers take other values, against those that are found anew there."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

import flexmb as fm
from flexmb.parameters import parameters
from flexmb.parameters.many_numbers import First, steady
from flexmb.parameters.numbers import numbers
from flexmb.parameters.parameters import Parameters
from tests.flexmb.parameters.test_together import BY, arm

VALUES = {"a": 2.0, "b": 3.0, "c": 0.0}
TABLES = {
    "linear": (lambda a, b, c: [4.0 * a, b + 1.0, 2.0 * c], {"a", "b", "c"}),
    "square": (lambda a, b, c: [a * a, b, c], {"b", "c"}),
    "product": (lambda a, b, c: [a * b, c], {"c"}),
    "one of its own and a product": (lambda a, b, c: [a, a * b, b, c], {"c"}),
    "a product that vanishes here": (lambda a, b, c: [a, b, a * c], set()),
    "a slope that vanishes here": (lambda a, b, c: [a * np.sin(c), b * b, c * c], set()),
}


def found(table, by=tuple(VALUES)):
    """What is steady among the numbers, with the tables as a function of them, and their derivatives by differences."""

    def at(values):
        return np.array(table(**VALUES | values), float)

    middle, firsts, rates = at({}), {}, []
    for name in by:
        value = VALUES[name] + 0.125
        other = at({name: value})
        places = np.flatnonzero(other != middle)
        firsts[name] = First(value, places, other[places])
        step = 1e-20j
        exact = np.array(table(**VALUES | {name: VALUES[name] + step})).imag / 1e-20
        rates.append(parameters.Derivative(exact, 0.0))
    return steady(at, middle, np.ones(len(middle)), {name: VALUES[name] for name in by}, firsts, rates), at


@pytest.mark.parametrize("name", TABLES)
def test_numbers_with_linear_entries_of_their_own_are_steady(name):
    table, expected = TABLES[name]
    assert set(found(table)[0].rates) == expected


def test_tables_that_are_not_as_predicted_end_it():
    """A kink beyond the interval, and a change of something that is none of the numbers."""
    held, at = found(lambda a, b, c: [abs(a) if isinstance(a, float) else a, b, c])
    assert held.predicts(at({"a": 0.5, "b": 7.0}), VALUES | {"a": 0.5, "b": 7.0})
    assert not held.predicts(at({"a": -0.5}), VALUES | {"a": -0.5})
    assert not held.predicts(at({}) + [0.0, 0.0, 1e-9], VALUES)


def test_a_number_that_cannot_change_so_far_leaves_none():
    """The same where another number was changed by nothing, of which one cannot know what it concerns."""
    held, at = found(lambda a, b, c: [a, b, c])
    none = steady(at, at({}), np.ones(3), VALUES, {}, [parameters.Derivative(np.zeros(3), 0.0)] * 3)
    assert held.rates and not none.rates


def test_they_are_those_that_are_found_anew_and_take_one_compilation(monkeypatch):
    system = arm()
    names = ["lower.mass_kg", "upper.inertia_kg_m2.0.0", "gravity_m_s2.1", "shoulder.rotation.stiffness_Nm_rad",
             "elbow.rotation.stiffness_Nm_rad", "upper.com_m.0"]  # fmt: skip
    first = Parameters(system, numbers(system.scene, names))
    other = {name: 1.3 * value for name, value in zip(names, first.values.tolist(), strict=True)}
    moved = fm.compile(system.scene.with_values(other))
    chosen = numbers(moved.scene, names)
    anew = Parameters(moved, chosen)
    compiled = []
    plain = parameters._Differentiation._at
    first.steady  # noqa: B018 - found once
    monkeypatch.setattr(parameters._Differentiation, "_at", lambda self, of: compiled.append(of) or plain(self, of))
    again = Parameters(moved, chosen, like=first)
    assert {"lower.mass_kg", "gravity_m_s2.1", "elbow.rotation.stiffness_Nm_rad"} <= set(again.steady.rates)
    assert len(compiled) <= 5  # of the mass centre, by which the inertia is quadratic, and of what shares its entries
    y = np.array([0.3, -0.2, 1.0, 2.0, 0.0])
    none = np.zeros((len(y), len(names)))
    of_again, of_anew = again.slopes(0.0, y, none), anew.slopes(0.0, y, none)
    assert np.max(np.abs(of_again - of_anew)) < 1e-11 * np.max(np.abs(of_anew))
    assert np.array_equal(again.reached, anew.reached)


def test_others_than_the_same_numbers_keep_nothing():
    system = arm()
    first = Parameters(system, numbers(system.scene, BY[:2]))
    other = Parameters(system, numbers(system.scene, BY[4:6]), like=first)
    assert set(other.steady.rates) == set(BY[4:6])


@pytest.mark.parametrize("names", [BY[:2], [BY[0], BY[2], BY[4]], [BY[1], BY[6]], [BY[0], BY[7]]], ids=" ".join)
def test_tables_that_are_put_in_place_are_those_made_anew(names):
    """Also along other directions; what workspaces have copies of is not put in place."""
    system = arm()
    first = Parameters(system, numbers(system.scene, names))
    places, scales = [2, *range(len(names) - 1)], np.linspace(0.1, 0.2, len(names) + 2)
    old = first.arranged(places, scales)
    other = {name: 1.3 * value for name, value in zip(names, first.values.tolist(), strict=True)}
    moved = fm.compile(system.scene.with_values(other))
    now = Parameters(moved, numbers(moved.scene, names), like=first)
    anew, again = now.arranged(places, 3.0 * scales), now.arranged(places, 3.0 * scales, (first, old))
    assert (again is old) == ("gravity_m_s2.1" not in names)
    for field in fields(type(anew[0].constants)):
        one, two = (getattr(each[0].constants, field.name) for each in (anew, again))
        assert one.tobytes() == two.tobytes(), field.name
        assert not two.flags.writeable
