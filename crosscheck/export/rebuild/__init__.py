"""Rebuild the equations of motion of an exported case, integrate them, and compare with the reference.

    python -m rebuild pendulums/double

This needs NumPy and SciPy alone; it is an example of how the data are to be read, and a check that they suffice. It
holds trees of rigid and modal bodies with wheels, point masses, loads and functions of time. Closures, connectors,
controllers and events it does not: it stops and says so. The equations are formed in the plainest way, from the
Jacobian J and the bias acceleration a of every inertia point,

    sum (m J'J + W' I W) udot = sum (m J'(g - a) - W'(I alpha + w x I w)) + loads,

so they share nothing with a recursion. All vectors are in World axes unless said otherwise.
"""

from .case import RebuiltCase as RebuiltCase
from .case import read_case as read_case
from .comparison import compare as compare
