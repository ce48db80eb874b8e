"""Fidelity levels: one file each, which declares the level as `LEVEL` (see `flexmb.levels.level`).

The kernel `inertia_and_bias` computes a body's modal mass matrix and bias force from one kinetic energy. It writes, for
body k in its own frame, `inertia` (rigid block, angular first), `pff`, `pfr` (modal block and coupling), `force` (rigid
part of the velocity-dependent bias) and `zf` (modal part). Accelerations are classical: the bias is the force at
wdot = 0, vdot = 0 (of the origin) and etaddot = 0.

A new level is a file here, its name in the list of `flexmb.levels.body` and in `flexmb.scene.bodies.Level`.
"""
