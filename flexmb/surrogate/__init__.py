"""Scenes derived from scenes: other models of the same flexible bodies, to compare models or to find a cheaper one.

A surrogate is an ordinary scene, and all engines get the same one, so that the error of a coarser model is never
mistaken for a difference between codes.
"""

from flexmb.scene.rigid_equivalent import rigidify as rigidify
from flexmb.surrogate.cuts import cut_where_loaded as cut_where_loaded
from flexmb.surrogate.points import modal_points as modal_points
from flexmb.surrogate.segments import finite_segments as finite_segments
from flexmb.surrogate.substructures import substructured as substructured
