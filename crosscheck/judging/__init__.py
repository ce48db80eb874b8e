"""Judging records: results with their uncertainties, a verdict on every channel, the outcome of a session."""
