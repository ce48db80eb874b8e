"""Any FMU of FMI 2 or 3 as an engine: its variables are channels of the scene by a mapping file; FMPy runs it."""

from crosscheck.engines.fmu.engine import FmuEngine as FmuEngine
