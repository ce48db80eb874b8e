"""Holding a CSV of any code against a case, as if an engine had run it."""
