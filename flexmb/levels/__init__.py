"""Fidelity levels: one file each, giving a body's modal mass matrix and bias force from one kinetic energy.

Every level fills, for body k in its own frame: `inertia` (rigid block, angular first), `pff`, `pfr` (modal block and
coupling), `force` (rigid part of the velocity-dependent bias) and `zf` (modal part). Accelerations are classical: the
bias is what remains when wdot = 0, vdot = 0 (of the origin) and etaddot = 0.
"""
