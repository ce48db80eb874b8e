"""Comparing a CSV of any code with a case, as if an engine had run it."""
