"""The least loads of closed chains where several sets go with the same motion, and users see NaN: for tests that
balance them."""

from __future__ import annotations

import numpy as np

import flexmb
from flexmb.tables.state import pack


def least_loads(
    system: flexmb.System, state: flexmb.State, algorithm: flexmb.Algorithm = "articulated"
) -> dict[str, np.ndarray]:
    """By hinge and closure (6,), World axes."""
    motion = system.constraints._motion(state.t, pack(state), algorithm)
    return system.constraints._by_load(motion.hinges, motion.closures)
