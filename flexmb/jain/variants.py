"""Dispatch of each body to the variant that eliminates its modes.

A scene in which every body uses the explicit variant has plain `Constants`, and its kernels contain no other variant
and no branch. A scene with condensed or Woodbury bodies has `ReducedConstants`, another type, for which the kernels are
compiled separately.
"""

from flexmb.jain import condensed, explicit, woodbury
from flexmb.jain.reduced import to_node
from flexmb.jit.kernel import by_bundle, helper
from flexmb.levels.body import body_inertia, inertia_without_masses
from flexmb.tables.arrays import CONDENSED, EXPLICIT, WOODBURY, ReducedConstants


@helper
def _inertia(c, w, k):
    if c.body[k].elimination == EXPLICIT:
        body_inertia(c, w, k)
    else:
        inertia_without_masses(c, w, k)  # a reduced body has no summed points (`flexmb.jain.elimination.applies`)


@helper
def _eliminate_modes(c, w, k):
    if c.body[k].elimination == CONDENSED:
        return condensed.eliminate_modes(c, w, k)
    if c.body[k].elimination == WOODBURY:
        return woodbury.eliminate_modes(c, w, k)
    return explicit.eliminate_modes(c, w, k)


@helper
def _to_parent(c, w, k, p, F, row):
    if c.body[k].node < 0:
        explicit.to_parent(c, w, k, p, F, row)
    else:
        to_node(c, w, k, p, F)


@helper
def _modal_accelerations(c, w, k, A):
    if c.body[k].elimination == CONDENSED:
        condensed.modal_accelerations(c, w, k, A)
    elif c.body[k].elimination == WOODBURY:
        woodbury.modal_accelerations(c, w, k, A)
    else:
        explicit.modal_accelerations(c, w, k, A)


inertia = by_bundle(ReducedConstants, _inertia, body_inertia)  # those parts of M_m and b_m that the variant needs
eliminate_modes = by_bundle(ReducedConstants, _eliminate_modes, explicit.eliminate_modes)
to_parent = by_bundle(ReducedConstants, _to_parent, explicit.to_parent)
modal_accelerations = by_bundle(ReducedConstants, _modal_accelerations, explicit.modal_accelerations)
