"""Derivatives of whole runs by the numbers of their scenes, and what they are for: fits and uncertainties."""
