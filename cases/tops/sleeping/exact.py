"""Lagrange's heavy top, which its spin keeps almost upright."""

from crosscheck.references.tops import HeavyTop

TOP = HeavyTop(spin=140.0, lean=0.01)
exact = TOP.exact
