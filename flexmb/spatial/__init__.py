"""Algebra of spatial vectors, rotations and inertias, as tuples of scalars that the compiler keeps in registers."""
