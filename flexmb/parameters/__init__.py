"""Derivatives by the numbers of a scene, the inertia regressor, and which of its parameters motions can identify."""
