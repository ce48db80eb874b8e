"""Comparison of an appendage with modes and a rigid body on a spring hinge, by the relations (149)-(151)."""
