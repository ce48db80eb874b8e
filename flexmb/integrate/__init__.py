"""Integrators: whole runs in one compiled loop, given a right-hand side; no mechanics here."""
