"""The force of a beam of level exact with masses applied against that with its mass matrix formed, both interpreted."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

import flexmb as fm
from flexmb.jain.derivatives import flexible
from flexmb.jain.derivatives.strained import strained_force
from flexmb.jain.derivatives.tables import duals
from flexmb.jit.counting import _counting
from flexmb.jit.lanes import LANES
from flexmb.levels.body import body_inertia
from flexmb.levels.section_motion import move_sections
from flexmb.scene import schema as s
from flexmb.tables.features import contained
from tests.flexmb.entry import interpreted
from tests.flexmb.entry.terms import Term, terms
from tests.flexmb.levels.strain_beams import BEAMS, beam

LUMPS = [s.TipMass(x_m=1.0, mass_kg=0.2, com_m=(0.03, -0.05, 0.08))]
"""Off the axis: points of the beam itself are on it."""


class Body(NamedTuple):
    """One moving beam: constants and workspace, where directions have their seeds, and an acceleration."""

    c: Any
    w: Any
    e: Any
    A: tuple[tuple[float, ...], tuple[float, ...]]


def moving(name: str, along: range) -> Body:
    """Directions: three components of the angular velocity, then displacements, then speeds of the modes."""
    system = fm.compile(beam(**BEAMS[name], tip_masses=LUMPS).weld("clamp", "ground", "rod").scene())
    rng, nm, w = np.random.default_rng(3), system.nu, system.workspace()
    w.eta[0, :nm], w.etad[0, :nm] = 0.3 * rng.normal(size=(2, nm))
    w.speed["acceleration"] = rng.normal(size=nm)
    w.body["velocity"][0] = rng.normal(size=6)
    c = _counting(system.constants, float)
    object.__setattr__(c, "_numba_type_", SimpleNamespace(features=contained(system.constants)))
    tables = duals(system.constants, system.nq, system.nu)
    e = SimpleNamespace(**{each: interpreted._as_duals(getattr(tables, each)) for each in tables.__dataclass_fields__})
    for i in range(6):
        e.body[0].velocity[i] += float(w.body["velocity"][0, i])
    for n in range(nm):
        e.eta[0, n] += float(w.eta[0, n])
        e.etad[0, n] += float(w.etad[0, n])
    for lane, n in enumerate(along[:LANES]):
        row, place = [(e.body[0].velocity, n), ((e.eta[0], e.etad[0])[(n - 3) // nm], (n - 3) % nm)][n >= 3]
        row[place] = interpreted._seeded(row[place], lane)
    return Body(c, _counting(w, float), e, tuple(map(tuple, rng.normal(size=(2, 3)).tolist())))


def rates(body: Body) -> np.ndarray:
    """(6+m,LANES) derivatives of the force and of the rows of the modes."""
    e, nm = body.e, body.c.body[0].modes
    return np.array([interpreted._rates(each) + np.zeros(LANES) for each in (*e.body[0].hinge_force, *e.zf[0][:nm])])


def directions(name: str) -> range:
    """Eight of every kind."""
    last = 3 + 2 * fm.compile(beam(**BEAMS[name]).weld("clamp", "ground", "rod").scene()).nu
    return range(0, last, -(-last // LANES))


def applied(name: str, term: Term | None = None) -> Body:
    """A beam with the force by applied masses, without a term of it."""
    body = moving(name, directions(name))
    with np.errstate(all="ignore"):
        interpreted._Without(term)(strained_force)(body.c, body.w, body.e, 0, body.A)
    return body


@cache
def formed(name: str) -> Body:
    """The same by the mass matrix."""
    run, body = interpreted._Without(None), moving(name, directions(name))
    for part in (move_sections, body_inertia):
        run(part)(body.c, body.e, 0)
    run(flexible._force)(body.c, body.w, body.e, 0, body.A)
    return body


@pytest.mark.parametrize("name", BEAMS)
def test_applied_masses_are_those_of_the_matrix(name):
    found, expected = rates(applied(name)), rates(formed(name))
    assert np.max(np.abs(found - expected)) < 1e-12 * np.max(np.abs(expected))
    assert np.all(np.max(np.abs(expected[:, : len(directions(name))]), axis=0) > 1e-3 * np.max(np.abs(expected)))
    force = [[each.real for each in body.e.body[0].hinge_force] for body in (applied(name), formed(name))]
    np.testing.assert_allclose(*force, rtol=0.0, atol=1e-12 * np.max(np.abs(force)))


def unnoticed(of: list[Term]) -> list[str]:
    """Those terms without which no beam differs."""
    found = []
    for term in of:
        for name in ("six strains", "plane"):
            expected = rates(formed(name))
            if not np.max(np.abs(rates(applied(name, term)) - expected)) < 1e-6 * np.max(np.abs(expected)):
                break
        else:
            found.append(f"{term.where}: {term.text}")
    return found


def test_some_terms_are_noticed():
    assert unnoticed(list(terms("strained"))[::30]) == []


@pytest.mark.slow
def test_every_term_is_noticed():
    assert unnoticed(list(terms("strained"))) == []
