"""The dense route: mass matrix and bias from node Jacobians, without recursion and without any code of the recursions.

Every inertia point of every body is followed along a motion by truncated Taylor series in time (value, first and second
derivative), so velocities and accelerations are exact. The Jacobian's column j is the velocity for u = e_j, the mass
matrix is sum m v'v + w'Jw over all points; loads are Newton's and Euler's laws summed over the outboard points. It is
slow, short and independent: the compiled algorithms, the recursion and Frisch's route, are checked against it. It
shares with them the scene and the modal data of flexible bodies, nothing else.
"""

from flexmb.dense.dense_system import DenseSystem as DenseSystem
