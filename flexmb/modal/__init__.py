"""Modal preprocessing: beams and raw modal data to inertia points, modes and modal integrals."""

from flexmb.modal.flexible import flexible_model as flexible_model
from flexmb.modal.integrals import ModalIntegrals as ModalIntegrals
from flexmb.modal.integrals import TurningPoints as TurningPoints
from flexmb.modal.integrals import modal_integrals as modal_integrals
