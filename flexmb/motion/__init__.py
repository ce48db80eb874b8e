"""Coordinates and speeds: what a state says of them, their rates, and steps on the manifold of rotations."""
