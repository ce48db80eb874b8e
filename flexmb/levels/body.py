"""The list of all fidelity levels, and M_m and b_m of a body by dispatch on its level.

The number of a level is its index in the list, whose order is that of the names in the schema.
"""

import numpy as np

from flexmb.jit.kernel import helper
from flexmb.jit.numbered import numbered
from flexmb.levels import exact, full, linear, rigid, ruthless, stiffened
from flexmb.levels.level import FidelityLevel
from flexmb.tables.features import LEVEL

LEVELS: tuple[FidelityLevel, ...] = tuple(module.LEVEL for module in (rigid, ruthless, linear, full, stiffened, exact))
BY_NAME = {level.name: level for level in LEVELS}


@helper
def _no_inertia(c, w, k):
    """Of a level by strains: it has no inertia points, and M_m and b_m of its bodies are integrals over their sections,
    which `inertia_of_points` leaves as they are."""


_inertia_and_bias = numbered("inertia_and_bias", LEVEL, [level.inertia_and_bias for level in LEVELS])
_of_points = numbered(
    "of_points", LEVEL, [_no_inertia if level.by_strain else level.inertia_and_bias for level in LEVELS]
)
_without_masses = numbered("without_masses", LEVEL, [level.without_masses for level in LEVELS])
AT_REST = f"{LEVEL} {[level.at_rest for level in LEVELS].index(True)}"
"""The feature of scenes that contain bodies with the kinematics of their undeformed shape."""

RIGID = f"{LEVEL} {LEVELS.index(rigid.LEVEL)}"
"""The feature of scenes that contain bodies of level rigid."""

_AT_REST = np.array([level.at_rest for level in LEVELS])


@helper
def body_inertia(c, w, k):
    """M_m and b_m of body k at its level."""
    _inertia_and_bias(c, c.body[k].level, c, w, k)


@helper
def inertia_of_points(c, w, k):
    """The same, of a body whose inertia is that of its inertia points; nothing where it is that of its sections."""
    _of_points(c, c.body[k].level, c, w, k)


@helper
def inertia_without_masses(c, w, k):
    """M_m and b_m without the parts of M_m that are constant and in tables, for bodies whose modes are condensed."""
    _without_masses(c, c.body[k].level, c, w, k)


@helper
def is_at_rest(level):
    """Whether inertia and kinematics of a body of this level are those of the undeformed shape."""
    return _AT_REST[level]
