"""Kratos: one beam on the ground by corotational finite elements, in Kratos' own implicit time integration."""

from crosscheck.engines.kratos.engine import KratosEngine as KratosEngine
