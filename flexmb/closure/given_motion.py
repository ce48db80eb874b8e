"""Everything observable of a closed chain whose accelerations and row loads are given, along seven directions at once.

As `flexmb.entry.given_motion` for a tree. The row loads, in cw.row.load, are independent like the accelerations: how
both depend on the state of a free motion is a matter of the directions (`flexmb.closure.variation`).
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from flexmb.closure.couplings import evaluate_coupling, is_coupling
from flexmb.closure.rows import evaluate_closure, load_on_b
from flexmb.closure.tables import CLOSURE_STATE, COUPLINGS, ROW_STATE, ClosureConstants
from flexmb.closure.unit_loads import apply_rows
from flexmb.entry.articulated import world_loads
from flexmb.entry.given_motion import invert, observe_others
from flexmb.jain.innovations import project
from flexmb.jain.response import Response, clear, response
from flexmb.jit.bundle import bundle
from flexmb.jit.duals import DUAL
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.wide_arrays import as_duals
from flexmb.spatial.spatial_vector import add6, store6, times6, vec6
from flexmb.spatial.vector import mat3
from flexmb.tables.arrays import Constants
from flexmb.tables.status import OK
from flexmb.typing import Real, Record


@bundle
class ResponseTangent(Response):
    """Forces on a system in dual numbers."""

    numbers = DUAL


@bundle
class RowsTangent:
    """The rows of closures and their loads in dual numbers."""

    numbers = DUAL

    closure: Record  # (C,) CLOSURE_STATE
    row: Record  # (G,) ROW_STATE; `load` is set by the caller
    loads: Real  # (C,6) of closures on body_b about frame B, World axes, written
    response: ResponseTangent


def rows_tangent(cc: ClosureConstants, c: Constants) -> RowsTangent:
    """All zero; one per thread."""
    like = response(c)
    return RowsTangent(
        closure=as_duals(np.zeros(len(cc.closure), CLOSURE_STATE)),
        row=as_duals(np.zeros(len(cc.row), ROW_STATE)),
        loads=as_duals(np.zeros((len(cc.closure), 6))),
        response=ResponseTangent(**{field.name: as_duals(getattr(like, field.name)) for field in fields(like)}),
    )


@kernel
def observe_given(x, c, w, cc, cw, out):
    """As `flexmb.entry.given_motion.observe_given` under the loads of the rows; those of closures go to cw.loads.

    The rows have the rates and accelerations of this motion, which need not keep the closures closed. What hinges
    transmit is the inertial load of all that they carry less the loads of closures on it.
    """
    status = invert(x, c, w)
    if status != OK:
        return status
    clear(c, cw.response)
    for i in range(cc.closure.shape[0]):
        if has(cc, COUPLINGS) and is_coupling(cc, i):
            evaluate_coupling(c, w, cc, cw, i, True)
        else:
            evaluate_closure(c, w, cc, cw, i, True)
        apply_rows(c, w, cc, cw, i)
        store6(cw.loads[i], 0, times6(mat3(cw.closure[i].world, 0), load_on_b(cc, cw, i)))
    _relieve_hinges(c, w, cw)
    world_loads(c, w, out.loads)
    for j in range(x.tau.shape[0]):
        out.drives[j] = x.tau[j] - w.speed[j].applied - cw.response.speed[j]
    observe_others(x, c, w, out)
    return OK


@helper
def _relieve_hinges(c, w, cw):
    """Pass the loads of closures from tip to base; what each hinge thereby need not transmit leaves w.body.load."""
    for k in range(c.body.shape[0] - 1, -1, -1):
        project(c, w, cw.response, k)
        add6(w.body[k].load, 0, vec6(cw.response.body[k].force, 0))
