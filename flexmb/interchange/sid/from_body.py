"""Standard Input Data of a flexible body of a scene, from sums over its inertia points to first order in the modes."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from flexmb.interchange.sid.blocks import Sid, SidNode, Taylor
from flexmb.modal.first_order import FirstOrder, first_order, steiner, symmetric
from flexmb.modal.flexible import flexible_model
from flexmb.modal.flexible_model import FlexibleModel, FlexibleNode, SecondOrder
from flexmb.scene.bodies import BeamBody, ModalBody
from flexmb.scene.quaternions import cross_matrix
from flexmb.typing import Real

ROWS, COLUMNS = (0, 1, 2, 0, 1, 2), (0, 1, 2, 1, 2, 0)
"""Indices of the six numbers of Oe in a symmetric matrix: xx, yy, zz, xy, yz, zx."""


def sid_of(body: BeamBody | ModalBody, folder: str | os.PathLike[str] | None = None) -> Sid:
    """All blocks of a flexible body, of order 1, in its body frame.

    `folder`: the folder of a modal body's file, if its name is relative. The geometric stiffness of a body of level
    "stiffened" is in Ct, Cr, Oe and the nodes. For a free-free body the node "origin" is omitted, because it is not
    fixed to the material. Raises ValueError for inconsistent data, and for a beam of level "exact".
    """
    if body.level == "exact":
        raise ValueError(
            f'beam "{body.name}" has level "exact", whose strains are no modes of Standard Input Data: write it with '
            'level "stiffened", which has the same geometric stiffness'
        )
    model = flexible_model(body, None if folder is None else Path(folder))
    m = model.mode_count
    sums, second = first_order(model), _second(model)
    Q = _moments(model)
    Gr0 = sums.E - cross_matrix(sums.C0)
    Gr1 = -2.0 * (Q - np.trace(Q, axis1=-2, axis2=-1)[..., None, None] * np.eye(3))
    spin, spin_slope = -0.5 * sums.E, -(sums.G + second.G)
    C1, L1, M1 = sums.C1 + second.C1, sums.L1 + second.L1, sums.M1 + second.M1
    gyration = np.swapaxes(C1, 0, 1) - C1
    return Sid(
        mass=sums.mass,
        modes=_mode_names(model, sums.M0),
        nodes=tuple(
            _node(name, node)
            for name, node in model.nodes.items()
            if model.clamped or np.any(node.translation) or np.any(node.rotation_modes)
        ),
        mdCM=Taylor(sums.s0[:, None], sums.L0.T[:, :, None]),
        J=Taylor(sums.J0, np.swapaxes(sums.E, 0, 1)),
        Ct=Taylor(sums.L0, L1.transpose(1, 0, 2)),
        Cr=Taylor(sums.C0, C1.transpose(1, 0, 2)),
        Me=Taylor(sums.M0, M1.transpose(1, 0, 2)),
        Gr=Taylor(_side_by_side(Gr0), np.stack([_side_by_side(Gr1[:, k]) for k in range(m)], axis=1)),
        Ge=Taylor(gyration.reshape(m, 3 * m)),
        Oe=Taylor(_six(spin), _six(spin_slope)),
        ksigma=Taylor(np.zeros((m, 1))),
        Ke=Taylor(model.stiffness),
        De=Taylor(model.damping),
    )


def _second(model: FlexibleModel) -> FirstOrder:
    """Contributions of a second-order field of the points to the first-order sums C1, L1, G and M1."""
    m = model.mode_count
    field = model.second
    if field is None:
        field = SecondOrder(*np.zeros((2, len(model.mass), 3, m, m)))
    G, H = (np.moveaxis(part, 1, -1) for part in (field.translation, field.rotation))  # (n,m,m,3)
    c, psi, J = model.com_offset, np.swapaxes(model.rotation, 1, 2), model.inertia
    G = G + np.cross(H, c[:, None, None])
    rho, u = model.position + c, np.swapaxes(model.translation, 1, 2) + np.cross(psi, c[:, None])
    swung = np.einsum("pab,pknb->pkna", J, H)
    turned = cross_matrix(H) @ J[:, None, None]
    M1 = np.einsum("p,pkna,pia->kni", model.mass, G, u) + np.einsum("pkna,pia->kni", swung, psi)
    return FirstOrder(
        mass=0.0, s0=np.zeros(3), J0=np.zeros((3, 3)), E=np.zeros((m, 3, 3)), C0=np.zeros((m, 3)),
        L0=np.zeros((m, 3)), M0=np.zeros((m, m)),
        L1=np.einsum("p,pkna->kna", model.mass, G),
        C1=np.einsum("p,pkna->kna", model.mass, np.cross(rho[:, None, None], G)) + swung.sum(axis=0),
        G=steiner(np.einsum("p,pkna,pb->knab", model.mass, G, rho)) + symmetric(turned).sum(axis=0),
        M1=M1 + np.swapaxes(M1, 1, 2),
    )  # fmt: skip


def _moments(model: FlexibleModel) -> Real:
    """Q_nk = sum m phi_n phi_k' (m,m,3,3) of all mass, with inertia tensors as masses that move with their points."""
    psi = np.swapaxes(model.rotation, 1, 2)
    u = np.swapaxes(model.translation, 1, 2) + np.cross(psi, model.com_offset[:, None])
    S = 0.5 * np.trace(model.inertia, axis1=1, axis2=2)[:, None, None] * np.eye(3) - model.inertia
    turned = cross_matrix(psi)
    return np.einsum("p,pna,pkb->nkab", model.mass, u, u, optimize=True) + np.einsum(
        "pnac,pcd,pkbd->nkab", turned, S, turned, optimize=True
    )


def _side_by_side(matrices: Real) -> Real:
    """Matrices (m,3,3) side by side, (3,3m)."""
    return np.concatenate(list(matrices), axis=1) if len(matrices) else np.zeros((3, 0))


def _six(symmetric: Real) -> Real:
    """Symmetric matrices A (...,3,3) as six numbers (...,6) with w' A w = six . w_q."""
    return symmetric[..., ROWS, COLUMNS] * np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])


def _node(name: str, node: FlexibleNode) -> SidNode:
    m = node.translation.shape[1]
    turned = cross_matrix(node.rotation_modes.T) @ node.rotation
    second = node.second
    return SidNode(
        name=name,
        origin=Taylor(node.position[:, None], node.translation[:, :, None]),
        phi=Taylor(node.translation, None if second is None else np.swapaxes(second.translation, 1, 2)),
        psi=Taylor(node.rotation_modes, None if second is None else np.swapaxes(second.rotation, 1, 2)),
        AP=Taylor(node.rotation, np.swapaxes(turned, 0, 1)),
        sigma=Taylor(np.zeros((6, 1)), np.zeros((6, m, 1))),
    )


def _mode_names(model: FlexibleModel, M: Real) -> tuple[str, ...]:
    frequency = np.sqrt(np.maximum(np.diag(model.stiffness) / np.diag(M), 0.0)) / (2.0 * np.pi)
    return tuple(f"'mode {k}: {f:.6g} Hz'" for k, f in enumerate(frequency, 1))
