"""Pinocchio: rigid trees in minimal coordinates, integrated by SciPy's DOP853."""

from crosscheck.engines.pinocchio.engine import PinocchioEngine as PinocchioEngine
