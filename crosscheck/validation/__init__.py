"""Predictions held against measurements, with a budget of uncertainty for every point (after ASME V&V 20-2009)."""
