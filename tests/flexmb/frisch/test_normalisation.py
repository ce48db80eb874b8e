"""Normalisation (41) and boundary conditions (46): the same body in other coordinates, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexmb.frisch.normalisation import check_boundary, normalised
from flexmb.frisch.parameters import mode_parameters
from flexmb.modal.flexible import flexible_model
from flexmb.modal.flexible_model import FlexibleNode
from tests.bounds import gamma, relative
from tests.flexmb.frisch import exact
from tests.flexmb.modal.beam_references import beam

BODY = exact.random_body(0)
STEPS = 3 * 20 * 20  # a dense eigenproblem of 3 modes and its products: a generous count of roundings


def old_from_new(old, new) -> np.ndarray:
    """X with shapes new = old X, from all shapes."""
    return np.linalg.lstsq(old.translation.reshape(-1, 3), new.translation.reshape(-1, 3), rcond=None)[0]


def test_modal_mass_is_the_mass_of_the_body():
    """(41), (45): M1 = m 1, stiffness m diag(omega^2) in ascending order."""
    new = normalised(BODY)
    p = mode_parameters(new)
    assert relative(p.M1, p.mass * np.eye(3)) <= gamma(STEPS)
    squares = np.diag(new.stiffness) / p.mass
    assert np.all(np.diff(squares) > 0.0)
    assert relative(new.stiffness, p.mass * np.diag(squares)) <= gamma(STEPS)
    given = np.sort(np.linalg.eigvals(np.linalg.solve(mode_parameters(BODY).M1, BODY.stiffness)).real)
    condition = np.linalg.cond(mode_parameters(BODY).M1)
    assert relative(squares, given) <= gamma(STEPS) * condition


def test_the_body_is_the_same_in_other_coordinates():
    """(43), (44): nodes, damping and every parameter are those of a_old = X a_new."""
    nodes = {"tip": FlexibleNode(np.ones(3), np.eye(3), BODY.translation[0], BODY.rotation[0])}
    body = replace(BODY, nodes=nodes)
    new = normalised(body)
    X = old_from_new(body, new)
    tip = new.nodes["tip"]
    assert relative(tip.translation, new.translation[0]) == 0.0
    assert relative(tip.rotation_modes, new.rotation[0]) == 0.0
    assert relative(new.damping, X.T @ body.damping @ X) <= gamma(STEPS)
    old, now = mode_parameters(body), mode_parameters(new)
    for name in "ABCQ":
        assert relative(getattr(now, name), X.T @ getattr(old, name)) <= gamma(STEPS), name
    for name in "DEHJ":
        assert relative(getattr(now, name), np.einsum("nab,nk->kab", getattr(old, name), X)) <= gamma(STEPS), name
    assert relative(now.F, np.einsum("mnab,mj,nk->jkab", old.F, X, X)) <= gamma(STEPS)
    for name in ("K", "A1", "Q1"):
        assert relative(getattr(now, name), np.einsum("mna,mj,nk->jka", getattr(old, name), X, X)) <= gamma(STEPS), name
    assert relative(now.M1_slope, np.einsum("kmn,kh,mi,nj->hij", old.M1_slope, X, X, X)) <= gamma(STEPS)


def test_modes_of_a_beam_are_only_scaled():
    """(41): eigenmodes with unit modal mass keep their order, their planes and their signs."""
    model = flexible_model(beam(6, 4))
    new = normalised(model)
    assert relative(new.translation, np.sqrt(model.mass.sum()) * model.translation) <= gamma(8)
    assert relative(normalised(new).translation, new.translation) <= gamma(8)


def test_dependent_modes_are_refused():
    """(41)."""
    double = replace(
        BODY,
        translation=BODY.translation[:, :, [0, 1, 0]],
        rotation=BODY.rotation[:, :, [0, 1, 0]],
        nodes={},
    )
    with pytest.raises(ValueError, match="boom: its modes are linearly dependent"):
        normalised(double, "boom")


@pytest.mark.parametrize("shape", ["translation", "rotation"])
def test_clamped_modes_that_move_the_origin_are_refused(shape):
    """(33), (46): seen at node "origin", and at an inertia point that lies there."""
    moved = np.zeros((3, 3))
    moved[2, 1] = 1e-3
    still = np.zeros((3, 3))
    clamp = (moved, still) if shape == "translation" else (still, moved)
    body = replace(BODY, nodes={"origin": FlexibleNode(np.zeros(3), np.eye(3), *clamp)})
    with pytest.raises(ValueError, match='boom: mode 1 moves the body origin \\(at node "origin"'):
        normalised(body, "boom")
    with pytest.raises(ValueError, match="boom: mode 1 moves the body origin"):
        mode_parameters(body, as_printed=True, name="boom")
    arrays = {key: getattr(BODY, key).copy() for key in ("position", "translation", "rotation")}
    arrays["position"][4] = 0.0
    arrays["translation"][4], arrays["rotation"][4] = clamp
    with pytest.raises(ValueError, match="at inertia point 4.*free-free"):
        check_boundary(replace(BODY, **arrays))
    check_boundary(replace(BODY, clamped=False, **arrays))


def test_clamped_beam_passes_and_free_beam_is_normalised():
    """(41), (46)."""
    check_boundary(flexible_model(beam(6, 4)))
    free = normalised(flexible_model(beam(6, 4, modes={"boundary": "free-free"})))
    p = mode_parameters(free)
    assert relative(p.M1, p.mass * np.eye(4)) <= gamma(STEPS)
