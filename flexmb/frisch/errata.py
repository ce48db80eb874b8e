"""The defects of the print that change results, each with a switch that keeps it."""

from __future__ import annotations

from enum import Enum


class Erratum(Enum):
    """A defect of TN D-8047; the value names the equations. docs/errata.md derives and measures each."""

    INERTIA_SLOPE = "(12), (52)"  # E_n without the turning of the elements' inertia
    ROTARY_CORIOLIS = "(72)"  # rotary part of K_mn produces power
    DROPPED_DEFORMATION = "(64), (96)"  # A_n, Q_n, M^1 and the rotary part of F_mn do not depend on deformation
    NO_LOADS_ON_MODES = "(110)"  # loads at nodes and gravity do not act on the modes
    ONE_SIDED = "(136), (138)"  # reduced by q' and h' instead of the whole transformation
    FIXED_SPIN_AXIS = "(131), (134)"  # the spin axis of a wheel does not turn with its node
    FIXED_SHAPES = "(118), (121), (124)"  # node frames turn by constant mode shapes
    SECOND_ORDER = "(49), (98)"  # G brings back second-order terms that Phi has dropped


CORRECTED: frozenset[Erratum] = frozenset()
AS_PRINTED: frozenset[Erratum] = frozenset(Erratum)
