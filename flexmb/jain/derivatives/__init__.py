"""Derivatives of the equations of motion by recursion, O(N depth): of M udot + b, then of udot by one solution.

docs/notation.md has the formulas, in the section on derivatives.
"""
