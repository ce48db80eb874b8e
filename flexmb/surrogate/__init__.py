"""Scene to scene: other models of the same flexible bodies, for whoever compares models or looks for a cheaper one.

A surrogate is a scene like any other and given to every engine alike, so that a coarser model is never mistaken for a
difference between codes.
"""

from flexmb.surrogate.points import modal_points as modal_points
from flexmb.surrogate.rigidified import rigidify as rigidify
from flexmb.surrogate.segments import finite_segments as finite_segments
from flexmb.surrogate.substructures import substructured as substructured
