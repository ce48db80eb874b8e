"""Kane's equations of free bodies with multipliers for their hinges, written for crosscheck alone in NumPy."""

from crosscheck.engines.kane.engine import KaneEngine as KaneEngine
