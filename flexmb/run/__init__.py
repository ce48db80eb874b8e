"""Runs: a system integrated in time, and what comes out of it."""
