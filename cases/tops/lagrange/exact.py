"""Lagrange's heavy top, released at a lean of 0.8 rad."""

from crosscheck.references.tops import HeavyTop

TOP = HeavyTop(spin=60.0, lean=0.8)
exact = TOP.exact
