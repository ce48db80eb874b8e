"""The force of a beam of level exact with masses applied against that with its mass matrix formed, both interpreted."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

import flexmb as fm
from flexmb.jain.derivatives import flexible
from flexmb.jain.derivatives.strained import strained_force, sum_strains
from flexmb.jain.derivatives.tables import duals
from flexmb.jit.counting import _counting
from flexmb.jit.duals import RATES
from flexmb.levels.body import body_inertia
from flexmb.levels.section_motion import move_sections
from flexmb.scene import schema as s
from tests.flexmb.entry import interpreted
from tests.flexmb.entry.terms import Term, terms
from tests.flexmb.entry.test_terms import unnoticed as unnoticed_in_scenes
from tests.flexmb.levels.strain_beams import BEAMS, SPACE, beam

LUMPS = [s.TipMass(x_m=1.0, mass_kg=0.2, com_m=(0.03, -0.05, 0.08))]
"""Off the axis: points of the beam itself are on it."""


class Body(NamedTuple):
    """One moving beam: constants and workspace, where directions have their seeds, and an acceleration."""

    c: Any
    w: Any
    e: Any
    A: tuple[tuple[float, ...], tuple[float, ...]]

    @property
    def modes(self) -> int:
        return int(self.c.body[0].modes)


def scene(**of_beam: Any) -> fm.Scene:
    """A clamped beam with a lump at its tip, and a wheel there and at its root, where no section carries it."""
    builder = beam(**of_beam, tip_masses=LUMPS).weld("clamp", "ground", "rod")
    for node in ("root", "tip"):
        builder.wheel(f"wheel.{node}", "rod", node=node, axis=(0.6, 0.0, 0.8), mass=0.3, axial_inertia=2e-3,
                      transverse_inertia=1e-3)  # fmt: skip
    return builder.scene()


def moving(of_beam: dict[str, Any], directions: int = RATES) -> Body:
    """Directions of all kinds: components of the angular velocity, displacements, speeds of the modes."""
    system = fm.compile(scene(**of_beam))
    rng, nm, w = np.random.default_rng(3), int(system.constants.body["modes"][0]), system.workspace()
    w.eta[0, :nm], w.etad[0, :nm] = 0.3 * rng.normal(size=(2, nm))
    w.speed["acceleration"] = rng.normal(size=system.nu)
    w.body["velocity"][0] = rng.normal(size=6)
    tables = duals(system.constants, system.nq, system.nu)
    names = tables.__dataclass_fields__
    e = interpreted.checked(SimpleNamespace(**{name: interpreted._as_duals(getattr(tables, name)) for name in names}))
    first = int(system.constants.body["etad_index"][0])
    for i in range(6):
        e.body[0].velocity[i] += float(w.body["velocity"][0, i])
    for n in range(nm):
        e.eta[0, n] += float(w.eta[0, n])
        e.etad[0, n] += float(w.etad[0, n])
        e.etadd[0, n] += float(w.speed["acceleration"][first + n])
    every = np.linspace(0, 2 + 2 * nm, directions, dtype=int).tolist()
    for lane, n in enumerate(every):
        row, place = (e.body[0].velocity, n) if n < 3 else ((e.eta[0], e.etad[0])[(n - 3) // nm], (n - 3) % nm)
        row[place] = interpreted._seeded(row[place], lane)
    A = tuple(map(tuple, rng.normal(size=(2, 3)).tolist()))
    c = interpreted.checked(interpreted.constants(system.constants))
    return Body(c, interpreted.checked(_counting(w, float)), e, A)


def rates(body: Body) -> np.ndarray:
    """(6+m,RATES) derivatives of the force and of the rows of the modes."""
    found = *body.e.body[0].hinge_force, *body.e.zf[0][: body.modes]
    return np.array([interpreted._rates(each) + np.zeros(RATES) for each in found])


def applied(name: str, term: Term | None = None) -> Body:
    """A beam with the force by applied masses, without a term of it."""
    body = moving(BEAMS[name])
    with np.errstate(all="ignore"):
        for part, more in ((sum_strains, ()), (strained_force, (body.A, (0, body.modes)))):
            interpreted._Without(term)(part)(body.c, body.e, 0, *more)
    return body


@cache
def formed(name: str) -> Body:
    """The same by the mass matrix."""
    run, body = interpreted._Without(None), moving(BEAMS[name])
    for part in (move_sections, body_inertia):
        run(part)(body.c, body.e, 0)
    run(flexible._force)(body.c, body.w, body.e, 0, body.A)
    return body


@pytest.mark.parametrize("name", BEAMS)
def test_applied_masses_are_those_of_the_matrix(name: str) -> None:
    bodies = applied(name), formed(name)
    found, expected = map(rates, bodies)
    assert np.max(np.abs(found - expected)) < 1e-12 * np.max(np.abs(expected))
    assert np.all(np.max(np.abs(expected), axis=0) > 1e-3 * np.max(np.abs(expected)))
    force = [[each.real for each in body.e.body[0].hinge_force] for body in bodies]
    np.testing.assert_allclose(*force, rtol=0.0, atol=1e-12 * np.max(np.abs(force)))


def test_twice_the_pieces_cost_a_direction_little_more_than_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """Products of duals, 2.2 times as many; to form the mass matrix takes 3.6 times as many, with more pieces eight."""
    products = []
    for pieces in (2, 4):
        body, met = moving({"modes": s.Modes(count=1, pieces=pieces, families=SPACE)}), []
        with monkeypatch.context() as patch:
            times = interpreted.Dual.__mul__
            patch.setattr(interpreted.Dual, "__mul__", lambda a, b, met=met, times=times: met.append(1) or times(a, b))
            for part, more in ((sum_strains, ()), (strained_force, (body.A, (0, body.modes)))):
                interpreted._Without(None)(part)(body.c, body.e, 0, *more)
        products.append(len(met))
    assert products[1] < 2.6 * products[0]


def unnoticed(of: list[Term]) -> list[str]:
    """Those terms without which no beam differs."""
    found = []
    for term in of:
        for name in ("six strains", "plane", "pieces"):
            expected = rates(formed(name))
            if not np.max(np.abs(rates(applied(name, term)) - expected)) < 1e-6 * np.max(np.abs(expected)):
                break
        else:
            found.append(f"{term.where}: {term.text}")
    return found


def test_some_terms_are_noticed() -> None:
    assert unnoticed(list(terms("strained"))[::30]) == []


@pytest.mark.slow
@pytest.mark.filterwarnings('ignore:scene "connected" is doubtful')
def test_every_term_is_noticed() -> None:
    """What ports hold is not there for a beam alone: such terms are tried in whole scenes."""
    alone = set(unnoticed(list(terms("strained"))))
    left = [term for term in terms("strained") if f"{term.where}: {term.text}" in alone]
    assert len(left) < 3
    assert unnoticed_in_scenes(left) == []
