"""Algebra of spatial vectors, rotations and inertias, as scalars that the compiler keeps in registers."""
