"""Basilisk: a spacecraft's hub with balanced wheels, hinged and sliding parts, integrated by SciPy's DOP853."""

from crosscheck.engines.basilisk.engine import BasiliskEngine as BasiliskEngine
