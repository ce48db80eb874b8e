"""Lagrange's heavy top, which its spin keeps almost upright."""

from crosscheck.references.tops import HeavyTop

exact = HeavyTop(spin=140.0, lean=0.01).exact
