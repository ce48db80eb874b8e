"""Lagrange's heavy top, released almost upright."""

from crosscheck.references.tops import HeavyTop

TOP = HeavyTop(spin=60.0, lean=0.01)
exact = TOP.exact
