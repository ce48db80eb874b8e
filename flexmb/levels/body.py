"""The list of all fidelity levels, and what follows from it: M_m and b_m of a body, whatever its level.

The number of a level is its place in the list, which has the order of the names in the schema.
"""

import numpy as np

from flexmb.jit.kernel import helper
from flexmb.jit.numbered import numbered
from flexmb.levels import full, linear, rigid, ruthless, stiffened
from flexmb.levels.level import FidelityLevel
from flexmb.tables.features import LEVEL

LEVELS: tuple[FidelityLevel, ...] = tuple(module.LEVEL for module in (rigid, ruthless, linear, full, stiffened))
BY_NAME = {level.name: level for level in LEVELS}

_inertia_and_bias = numbered("inertia_and_bias", LEVEL, [level.inertia_and_bias for level in LEVELS])
_without_masses = numbered("without_masses", LEVEL, [level.without_masses for level in LEVELS])
AT_REST = f"{LEVEL} {[level.at_rest for level in LEVELS].index(True)}"
"""The feature of scenes with bodies whose kinematics are those of their rest shape."""

RIGID = f"{LEVEL} {LEVELS.index(rigid.LEVEL)}"
"""The feature of scenes with bodies of level rigid."""

_AT_REST = np.array([level.at_rest for level in LEVELS])


@helper
def body_inertia(c, w, k):
    """M_m and b_m of body k at its level."""
    _inertia_and_bias(c, c.body[k].level, c, w, k)


@helper
def inertia_without_masses(c, w, k):
    """The same as far as constant modal masses M_ff, eliminated from tables made before the run, ask for it."""
    _without_masses(c, c.body[k].level, c, w, k)


@helper
def is_at_rest(level):
    """Whether inertia and kinematics of a body of this level are those of its rest shape."""
    return _AT_REST[level]
