"""Exudyn as an engine (FFRF bodies and redundant rigid bodies), and its geometrically exact beams as a second one."""

from crosscheck.engines.exudyn.beam_engine import ExudynBeamEngine
from crosscheck.engines.exudyn.engine import ExudynEngine

__all__ = ["ExudynBeamEngine", "ExudynEngine"]
