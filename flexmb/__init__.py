"""O(N) dynamics of trees of rigid and flexible bodies.

    import flexmb as fm
    scene = fm.load_scene("scene.toml")
    trajectory = fm.simulate(scene, t_end=10.0)

Names are imported when they are first used: a command's `--help` loads no library, reading a scene compiles nothing and
loads no plotting.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

# The public names are those of `flexmb.scene.schema.__all__`, and these of other modules.
_HOME = {
    "flexmb.advisor.advice": "Advice advise",
    "flexmb.closure.closures": "ClosureError",
    "flexmb.control.user": "user_function",
    "flexmb.linear.base_excitation": "BaseExcitation base_excitation",
    "flexmb.linear.campbell": "Campbell campbell",
    "flexmb.linear.controlled_motion": "ControlledDerivatives ControlledMotion",
    "flexmb.linear.equilibrium": "Equilibrium equilibrium",
    "flexmb.linear.equilibrium_path": "CriticalPoint EquilibriumPath equilibrium_path",
    "flexmb.linear.linear_model": "LinearModel",
    "flexmb.linear.linearize": "linearize",
    "flexmb.linear.linearize_sampled": "linearize_sampled",
    "flexmb.linear.margins": "LoopTransfer",
    "flexmb.linear.newton": "EquilibriumError",
    "flexmb.linear.random_response": "RandomResponse SpectralDensity random_response",
    "flexmb.linear.sampled_model": "SampledModel",
    "flexmb.linear.spin": "steady_spin SteadySpin",
    "flexmb.linear.stability_map": "MultiplierMap stability_map",
    "flexmb.run.batch_trajectory": "BatchTrajectory",
    "flexmb.run.envelope": "Envelope Extremes",
    "flexmb.run.event_record": "EventRecord",
    "flexmb.run.interruption": "Interrupted",
    "flexmb.run.restart": "Restart",
    "flexmb.run.simulate": "simulate",
    "flexmb.run.simulate_batch": "simulate_batch",
    "flexmb.run.stages": "RunStage simulate_stages",
    "flexmb.run.trajectory": "Trajectory",
    "flexmb.scene.build": "SceneBuilder",
    "flexmb.scene.files": "load_scene save_scene",
    "flexmb.scene.open_loop": "open_loop",
    "flexmb.scene.problems": "SceneError SceneWarning",
    "flexmb.scene.user_code": "no_user_code",
    "flexmb.sensitivity.fit": "Fit fit",
    "flexmb.sensitivity.gradient": "Gradient gradient",
    "flexmb.sensitivity.jump": "EventError",
    "flexmb.sensitivity.scalars": "FinalValue Misfit TimeIntegral",
    "flexmb.sensitivity.sensitivities": "EventSensitivity Sensitivities sensitivities",
    "flexmb.sensitivity.uncertainty": "Uncertainties uncertainty",
    "flexmb.system.batch": "Batch",
    "flexmb.system.compile": "compile compile_batch",
    "flexmb.system.derivative_records": "AccelerationDerivatives EvaluationDerivatives InverseDynamicsDerivatives",
    "flexmb.system.kinks": "NotDifferentiableError",
    "flexmb.system.observables": "Evaluation",
    "flexmb.system.starting": "check_scene",
    "flexmb.system.system": "System",
    "flexmb.tables.state": "DynamicsError PrecisionWarning State",
    "flexmb.tables.status": "Status",
}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names.split()}

_MODULES = {"schema": "flexmb.scene.schema", "scene": "flexmb.scene"}
"""Modules that scripts reach without importing them: `flexmb.schema.Scene`, `flexmb.scene.quaternions`."""

if TYPE_CHECKING:  # the same names for type checkers and editors, which do not execute `__getattr__`; a test compares
    from flexmb.advisor.advice import Advice as Advice
    from flexmb.advisor.advice import advise as advise
    from flexmb.closure.closures import ClosureError as ClosureError
    from flexmb.control.user import user_function as user_function
    from flexmb.linear.base_excitation import BaseExcitation as BaseExcitation
    from flexmb.linear.base_excitation import base_excitation as base_excitation
    from flexmb.linear.campbell import Campbell as Campbell
    from flexmb.linear.campbell import campbell as campbell
    from flexmb.linear.controlled_motion import ControlledDerivatives as ControlledDerivatives
    from flexmb.linear.controlled_motion import ControlledMotion as ControlledMotion
    from flexmb.linear.equilibrium import Equilibrium as Equilibrium
    from flexmb.linear.equilibrium import equilibrium as equilibrium
    from flexmb.linear.equilibrium_path import CriticalPoint as CriticalPoint
    from flexmb.linear.equilibrium_path import EquilibriumPath as EquilibriumPath
    from flexmb.linear.equilibrium_path import equilibrium_path as equilibrium_path
    from flexmb.linear.linear_model import LinearModel as LinearModel
    from flexmb.linear.linearize import linearize as linearize
    from flexmb.linear.linearize_sampled import linearize_sampled as linearize_sampled
    from flexmb.linear.margins import LoopTransfer as LoopTransfer
    from flexmb.linear.newton import EquilibriumError as EquilibriumError
    from flexmb.linear.random_response import RandomResponse as RandomResponse
    from flexmb.linear.random_response import SpectralDensity as SpectralDensity
    from flexmb.linear.random_response import random_response as random_response
    from flexmb.linear.sampled_model import SampledModel as SampledModel
    from flexmb.linear.spin import SteadySpin as SteadySpin
    from flexmb.linear.spin import steady_spin as steady_spin
    from flexmb.linear.stability_map import MultiplierMap as MultiplierMap
    from flexmb.linear.stability_map import stability_map as stability_map
    from flexmb.run.batch_trajectory import BatchTrajectory as BatchTrajectory
    from flexmb.run.envelope import Envelope as Envelope
    from flexmb.run.envelope import Extremes as Extremes
    from flexmb.run.event_record import EventRecord as EventRecord
    from flexmb.run.interruption import Interrupted as Interrupted
    from flexmb.run.restart import Restart as Restart
    from flexmb.run.simulate import simulate as simulate
    from flexmb.run.simulate_batch import simulate_batch as simulate_batch
    from flexmb.run.stages import RunStage as RunStage
    from flexmb.run.stages import simulate_stages as simulate_stages
    from flexmb.run.trajectory import Trajectory as Trajectory
    from flexmb.scene import schema as schema
    from flexmb.scene.build import SceneBuilder as SceneBuilder
    from flexmb.scene.connectors import *  # noqa: F403  (the schema's names, those of connectors and hinges among them)
    from flexmb.scene.files import load_scene as load_scene
    from flexmb.scene.files import save_scene as save_scene
    from flexmb.scene.hinges import *  # noqa: F403
    from flexmb.scene.open_loop import open_loop as open_loop
    from flexmb.scene.problems import SceneError as SceneError
    from flexmb.scene.problems import SceneWarning as SceneWarning
    from flexmb.scene.schema import *  # noqa: F403
    from flexmb.scene.user_code import no_user_code as no_user_code
    from flexmb.sensitivity.fit import Fit as Fit
    from flexmb.sensitivity.fit import fit as fit
    from flexmb.sensitivity.gradient import Gradient as Gradient
    from flexmb.sensitivity.gradient import gradient as gradient
    from flexmb.sensitivity.jump import EventError as EventError
    from flexmb.sensitivity.scalars import FinalValue as FinalValue
    from flexmb.sensitivity.scalars import Misfit as Misfit
    from flexmb.sensitivity.scalars import TimeIntegral as TimeIntegral
    from flexmb.sensitivity.sensitivities import EventSensitivity as EventSensitivity
    from flexmb.sensitivity.sensitivities import Sensitivities as Sensitivities
    from flexmb.sensitivity.sensitivities import sensitivities as sensitivities
    from flexmb.sensitivity.uncertainty import Uncertainties as Uncertainties
    from flexmb.sensitivity.uncertainty import uncertainty as uncertainty
    from flexmb.system.batch import Batch as Batch
    from flexmb.system.compile import compile as compile
    from flexmb.system.compile import compile_batch as compile_batch
    from flexmb.system.derivative_records import AccelerationDerivatives as AccelerationDerivatives
    from flexmb.system.derivative_records import EvaluationDerivatives as EvaluationDerivatives
    from flexmb.system.derivative_records import InverseDynamicsDerivatives as InverseDynamicsDerivatives
    from flexmb.system.kinks import NotDifferentiableError as NotDifferentiableError
    from flexmb.system.observables import Evaluation as Evaluation
    from flexmb.system.starting import check_scene as check_scene
    from flexmb.system.system import System as System
    from flexmb.tables.state import DynamicsError as DynamicsError
    from flexmb.tables.state import PrecisionWarning as PrecisionWarning
    from flexmb.tables.state import State as State
    from flexmb.tables.status import Status as Status


def __getattr__(name: str) -> Any:
    import_module("flexmb.forks")  # from now on forks wait for imports by other threads
    if name in _MODULES:
        import_module("flexmb.scene.build")  # imports all modules of the room
        return import_module(_MODULES[name])
    if name == "__all__":
        value = [*_MODULE_OF, *import_module("flexmb.scene.schema").__all__]
    elif name in _MODULE_OF:
        value = getattr(import_module(_MODULE_OF[name]), name)
    elif name[:1].isupper() and name in import_module("flexmb.scene.schema").__all__:  # its names are all capitalised
        value = getattr(import_module("flexmb.scene.schema"), name)
    else:
        raise AttributeError(f"module 'flexmb' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__getattr__("__all__")})
