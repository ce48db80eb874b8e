"""The dense route: mass matrix and bias from node Jacobians, with no recursion and nothing shared with the sweeps.

Every inertia point of every body is followed along a motion by truncated Taylor series in time (value, first and
second derivative), so velocities and accelerations are exact. The Jacobian's column j is the velocity for u = e_j, the
mass matrix is sum m v'v + w'Jw over all points; loads are Newton's and Euler's laws summed over the outboard points.
Slow, short and independent: what the compiled recursions are checked against.
"""

from flexmb.dense.dense_system import DenseSystem as DenseSystem
