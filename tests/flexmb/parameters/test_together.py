"""Derivatives of tables by many numbers at once against those by each number alone."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import flexmb as fm
from flexmb.parameters import many_numbers, parameters
from flexmb.parameters.parameters import ParameterError
from flexmb.parameters.spectral import Parts
from flexmb.ready import scenes

BY = [
    "upper.mass_kg", "lower.mass_kg", "upper.com_m.0", "lower.inertia_kg_m2.1.1", "shoulder.rotation.stiffness_Nm_rad",
    "elbow.rotation.stiffness_Nm_rad", "elbow.parent_position_m.0", "gravity_m_s2.1",
]  # fmt: skip


def arm() -> fm.System:
    builder = fm.SceneBuilder("arm", gravity=(0.0, -9.81, 0.0))
    builder.rigid_body("upper", mass=2.0, com=(0.4, 0.1, 0.0), inertia=(0.1, 0.2, 0.2))
    builder.rigid_body("lower", mass=1.0, com=(0.3, 0.0, 0.0), inertia=(0.05, 0.1, 0.1))
    builder.revolute("shoulder", "ground", "upper", stiffness=3.0)
    builder.revolute("elbow", "upper", "lower", parent_position=(0.8, 0.0, 0.0), stiffness=2.0)
    return fm.compile(builder.scene())


def tables(system: fm.System, names: list[str]) -> np.ndarray:
    found = system.parameters(names)
    state = system.initial_state
    y = np.concatenate([state.q + 0.3, state.u + 1.0, [0.0]])
    return found.slopes(0.0, y, np.zeros((len(y), len(names))))


def test_they_are_those_of_each_number_alone():
    alone = np.column_stack([tables(arm(), [name]) for name in BY])
    assert np.max(np.abs(tables(arm(), BY) - alone)) < 1e-11 * np.max(np.abs(alone))


def test_numbers_of_different_bodies_are_changed_together(monkeypatch):
    """Each number is changed once alone, which also counts as the first of the four changes of its group."""
    compiled = []
    plain = parameters._Differentiation._at
    monkeypatch.setattr(parameters._Differentiation, "_at", lambda self, of: compiled.append(of) or plain(self, of))
    arm().parameters(BY)
    assert len(compiled) < 3.0 * len(BY)


def test_a_number_without_a_derivative_is_named():
    """A number in whose group something goes wrong is differentiated alone, and says what is wrong."""
    scene = scenes.panelled(2, "full").scene()
    with pytest.raises((ParameterError, ValueError), match="panel.modes.count"):
        fm.compile(scene).parameters(["bob.mass_kg", "panel.modes.count"])


def test_entries_that_change_unexpectedly_break_up_the_group(monkeypatch):
    """Negative control: where the entries that a number concerns are not all known, its group is not used."""
    plain = many_numbers._concerned

    def incomplete(tables, number):
        found = plain(tables, number)
        if number.name == "upper.mass_kg":
            found[np.flatnonzero(found)[:1]] = False
        return found

    alone = np.column_stack([tables(arm(), [name]) for name in BY])
    monkeypatch.setattr(many_numbers, "_concerned", incomplete)
    assert np.max(np.abs(tables(arm(), BY) - alone)) < 1e-11 * np.max(np.abs(alone))


@pytest.mark.parametrize(
    ("bent", "straight"),
    [
        (lambda x: 3.0 * x, True),
        (lambda x: 3.0 * x + 1e-9 * abs(x - 2.0), False),
        (lambda x: 3.0 * x + 1e-9 * (x - 2.0) ** 2, False),
        (lambda x: 3.0 * x + 1e-9 * (x - 2.0) ** 3, False),
        (lambda x: 3.0 * x + 1e-9 * max(x - 2.1, 0.0), False),
    ],
)
def test_two_points_suffice_only_where_entries_are_linear(bent, straight):
    """Negative controls: a bend of a billionth is seen, be it even or odd, at the value or beside it."""
    pair = [SimpleNamespace(name=name, value=2.0, scale=2.0) for name in "ab"]

    def tables(values):
        a, b = (values.get(name, 2.0) for name in "ab")
        return np.array([1.0, bent(a), 5.0 * b])

    found = many_numbers._linear(
        tables, pair, [many_numbers._concerned(tables, each) for each in pair], [0, 1], Parts([slice(0, 3)])
    )
    assert (0 in found) is straight
    assert found[1].values == pytest.approx([0.0, 0.0, 5.0], rel=1e-14)
