"""Flexible or rigid on a spring? An appendage by its modes against a rigid body on a spring hinge, by (149)-(151)."""
