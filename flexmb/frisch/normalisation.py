"""The paper's conditions on modes: clamped at the hinge point, (46), and normalised to the mass of the body, (41)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import eigh

from flexmb.frisch.elements import elements, mass_centre, particles, rotary
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.typing import Real

# Relative size below which a shape counts as zero at the clamp: files with ten printed digits satisfy it.
_PRINTED = 1e-9


def check_boundary(model: FlexibleModel, name: str = "flexible body") -> None:
    """Raise ValueError unless clamped modes vanish at the body origin in translation and rotation: (33), (46).

    This looks at node "origin" and at all nodes and inertia points that lie at the origin. The message names the body,
    the place, the mode (counted from 0) and the remedy.
    """
    n = model.mode_count
    if not model.clamped or n == 0:
        return
    size = float(np.max(np.linalg.norm(model.position, axis=1)))
    moved = max(float(np.max(np.abs(model.translation))), size * float(np.max(np.abs(model.rotation))))
    near = _PRINTED * size
    shapes = [
        (f'node "{key}"', node.translation, node.rotation_modes)
        for key, node in model.nodes.items()
        if key == "origin" or float(np.linalg.norm(node.position)) <= near
    ]
    shapes += [
        (f"inertia point {i}", model.translation[i], model.rotation[i])
        for i in np.flatnonzero(np.linalg.norm(model.position, axis=1) <= near)
    ]
    for place, translation, rotation in shapes:
        largest = np.maximum(np.max(np.abs(translation), axis=0), size * np.max(np.abs(rotation), axis=0))
        if np.any(largest > _PRINTED * moved):
            mode = int(np.argmax(largest))
            raise ValueError(
                f"{name}: mode {mode} moves the body origin (at {place}), but clamped modes vanish there in "
                "translation and rotation; subtract the rigid-body motion from the mode, move the body frame to the "
                'clamp, or make the boundary "free-free"'
            )


def normalised(model: FlexibleModel, name: str = "flexible body") -> FlexibleModel:
    """The same body with modes normalised by (41): modal mass m_body times the unit matrix, stiffness diagonal.

    The new modes span the same space as the given ones. Their stiffness is m_body diag(omega^2) in ascending order, as
    in (45); damping is transformed along. Modes that are orthogonal already keep their order and are only scaled. The
    sign of a new mode is such that its largest component along a given one is positive. Coordinates change by a_old = X
    a_new, X' M1 X = m_body 1. Raises ValueError if clamped modes move the body origin, or if modes are linearly
    dependent.
    """
    check_boundary(model, name)
    if model.mode_count == 0:
        return model
    every = elements(model)
    M1 = particles(every, mass_centre(every)).M1 + rotary(every).M1
    return combined(model, np.sqrt(every.mass.sum()) * _orthonormal(M1, model.stiffness, name))


def combined(model: FlexibleModel, X: Real) -> FlexibleModel:
    """The body with combinations of its modes: coordinates a_old = X a_new, X (n,k)."""
    nodes = {
        key: replace(node, translation=node.translation @ X, rotation_modes=node.rotation_modes @ X)
        for key, node in model.nodes.items()
    }
    return replace(
        model, translation=model.translation @ X, rotation=model.rotation @ X, nodes=nodes,
        stiffness=X.T @ model.stiffness @ X, damping=X.T @ model.damping @ X,
    )  # fmt: skip


def _orthonormal(M1: Real, stiffness: Real, name: str) -> Real:
    """X with X' M1 X = 1 and X' K X diagonal, for symmetric M1, K (n,n)."""
    d = np.diag(M1)
    scale = np.where(d > 0.0, 1.0 / np.sqrt(np.where(d > 0.0, d, 1.0)), 0.0)
    mass = M1 * np.outer(scale, scale)
    round_off = 64 * len(d) * np.finfo(float).eps  # of eigenvalues and of sums over inertia points, at unit diagonal
    if np.linalg.eigvalsh(mass)[0] <= round_off:
        raise ValueError(f"{name}: its modes are linearly dependent, or one moves no mass; leave one of them out")
    K = stiffness * np.outer(scale, scale)
    k = np.diag(K)
    apart = np.abs(mass - np.eye(len(d))) <= round_off
    unsprung = np.abs(K - np.diag(k)) <= round_off * np.sqrt(np.abs(np.outer(k, k)))
    if np.all(apart) and np.all(unsprung):
        return np.diag(scale)
    X = scale[:, None] * eigh(0.5 * (K + K.T), 0.5 * (mass + mass.T))[1]
    largest = np.argmax(np.abs(X / scale[:, None]), axis=0)
    return X * np.where(X[largest, np.arange(len(d))] < 0.0, -1.0, 1.0)
