"""Derivatives of accelerations and eigenfrequencies: coordinates, matrices, their errors, and differences."""
