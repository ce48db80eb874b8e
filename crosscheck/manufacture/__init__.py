"""Manufactured motions: a motion is prescribed, and the loads that make it exact are found by the dense route.

The order: `motion` draws the motion, `drives` finds motors and loads at nodes, `doubt` says how far the motion of the
scene as written is from it, `case` writes both as a case, `orders` holds integrators against it.
"""
