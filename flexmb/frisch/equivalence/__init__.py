"""Flexible or rigid on a spring? An appendage with modes against a rigid body on a spring hinge, by (149)-(151)."""
