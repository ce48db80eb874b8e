"""In which axes methods on Lie groups add up speeds: see `resolve` of `flexmb.integrate.problem.StiffProblem`."""

FIXED, TURNING, RATES = range(3)
"""Velocities to the axes of increments; velocities back to the axes of u; rates of u to rates in the former."""
