"""Coordinates and speeds: taken from a state, their rates, and increments on the manifold of rotations."""
