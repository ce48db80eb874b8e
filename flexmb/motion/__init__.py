"""Coordinates and speeds: read from a state, their rates, and steps on the manifold of rotations."""
