"""OpenSim: rigid trees in Simbody's minimal coordinates, integrated by SciPy's DOP853."""

from crosscheck.engines.opensim.engine import OpensimEngine as OpensimEngine
