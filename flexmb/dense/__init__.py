"""The dense route: an independent implementation of the equations of motion, against which the tests hold the others.

Every inertia point of every body is followed along a motion by truncated Taylor series in time (value, first and second
derivative), so that velocities and accelerations are exact. Column j of the Jacobian is the velocity for u = e_j; the
mass matrix is the sum of m v'v + w'Jw over all points; loads follow from Newton's and Euler's laws summed over the
outboard points. It is slow and short. It shares the scene and the modal data of flexible bodies with the compiled
algorithms (the recursion, and Frisch's equations), and nothing else.
"""

from flexmb.dense.dense_system import DenseSystem as DenseSystem
