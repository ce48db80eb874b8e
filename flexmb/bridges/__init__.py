"""Bridges to libraries that differentiate programs: a system's equations as functions with exact derivatives there.

Each file imports its library, which flexmb does not need otherwise: `flexmb.bridges.jax`, `flexmb.bridges.torch`,
`flexmb.bridges.casadi`.
"""
