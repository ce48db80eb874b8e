"""Modal preprocessing: from beams or raw modal data to inertia points, mode shapes and modal integrals.

A beam passes through `section`, `interpolation`, `stations`, `beam` (finite elements), `reduce` (modes),
`element_points` and, at level stiffened, `second_order` and `equivalent`; raw data enter at `raw`. Both end as a
`FlexibleModel`, of which `integrals` and `first_order` compute the tables of the equations of motion.
"""

from flexmb.modal.flexible import flexible_model as flexible_model
from flexmb.modal.integrals import ModalIntegrals as ModalIntegrals
from flexmb.modal.integrals import TurningPoints as TurningPoints
from flexmb.modal.integrals import modal_integrals as modal_integrals
