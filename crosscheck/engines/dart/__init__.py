"""DART: rigid trees in minimal coordinates, hybrid dynamics of its own, integrated by SciPy's DOP853."""

from crosscheck.engines.dart.engine import DartEngine as DartEngine
