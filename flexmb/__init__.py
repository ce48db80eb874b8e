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

if TYPE_CHECKING:
    from flexmb.advisor.advice import Advice, advise
    from flexmb.closure.closures import ClosureError
    from flexmb.control.user import user_function
    from flexmb.linear.campbell import Campbell, campbell
    from flexmb.linear.equilibrium import equilibrium
    from flexmb.linear.linear_model import LinearModel
    from flexmb.linear.linearize import linearize
    from flexmb.linear.newton import EquilibriumError
    from flexmb.linear.spin import SteadySpin, steady_spin
    from flexmb.run.batch_trajectory import BatchTrajectory
    from flexmb.run.event_record import EventRecord
    from flexmb.run.interruption import Interrupted
    from flexmb.run.restart import Restart
    from flexmb.run.simulate import simulate
    from flexmb.run.simulate_batch import simulate_batch
    from flexmb.run.stages import RunStage, simulate_stages
    from flexmb.run.trajectory import Trajectory
    from flexmb.scene import schema as schema
    from flexmb.scene.build import SceneBuilder
    from flexmb.scene.check import SceneError, SceneWarning, check_scene
    from flexmb.scene.files import load_scene, save_scene
    from flexmb.scene.open_loop import open_loop
    from flexmb.scene.schema import *  # noqa: F403  (the schema's names are part of this API)
    from flexmb.scene.user_code import no_user_code
    from flexmb.system.batch import Batch
    from flexmb.system.compile import compile, compile_batch
    from flexmb.system.observables import Evaluation
    from flexmb.system.tree_system import System
    from flexmb.tables.state import DynamicsError, PrecisionWarning, State
    from flexmb.tables.status import Status

_LATER = {
    "Advice": "flexmb.advisor.advice",
    "advise": "flexmb.advisor.advice",
    "Campbell": "flexmb.linear.campbell",
    "campbell": "flexmb.linear.campbell",
    "ClosureError": "flexmb.closure.closures",
    "equilibrium": "flexmb.linear.equilibrium",
    "EquilibriumError": "flexmb.linear.newton",
    "linearize": "flexmb.linear.linearize",
    "Interrupted": "flexmb.run.interruption",
    "LinearModel": "flexmb.linear.linear_model",
    "steady_spin": "flexmb.linear.spin",
    "SteadySpin": "flexmb.linear.spin",
    "Restart": "flexmb.run.restart",
    "simulate": "flexmb.run.simulate",
    "simulate_batch": "flexmb.run.simulate_batch",
    "EventRecord": "flexmb.run.situation",
    "simulate_stages": "flexmb.run.stages",
    "RunStage": "flexmb.run.stages",
    "BatchTrajectory": "flexmb.run.batch_trajectory",
    "SceneBuilder": "flexmb.scene.build",
    "check_scene": "flexmb.scene.check",
    "SceneError": "flexmb.scene.problems",
    "SceneWarning": "flexmb.scene.problems",
    "load_scene": "flexmb.scene.files",
    "save_scene": "flexmb.scene.files",
    "open_loop": "flexmb.scene.open_loop",
    "no_user_code": "flexmb.scene.user_code",
    "Batch": "flexmb.system.batch",
    "compile_batch": "flexmb.system.compile",
    "Status": "flexmb.tables.status",
    "DynamicsError": "flexmb.tables.state",
    "Evaluation": "flexmb.system.observables",
    "PrecisionWarning": "flexmb.tables.state",
    "State": "flexmb.tables.state",
    "System": "flexmb.system.tree_system",
    "compile": "flexmb.system.compile",
    "Trajectory": "flexmb.run.trajectory",
    "user_function": "flexmb.control.user",
}

_OF_SCHEMA = (  # a test holds them to `schema.__all__`, which is not read before one of them is used
    "Action", "AngularCoordinate", "AngularFriction", "AngularSpring", "BeamBody", "BeamNode", "BeamStation", "Body",
    "Bushing", "Change", "Closure", "Connector", "Constant", "ControlSignal", "Controller", "CoordinateSensor",
    "Cylindrical", "DistanceSensor", "DriveSensor", "EndRun", "Free", "Function", "GainTable", "Gimbal", "Hinge",
    "Impact", "InertiaPoint", "Latch", "Level", "LinearCoordinate", "LinearFriction", "LinearSpring", "Load",
    "LoadSensor", "Marker", "MarkerSensor", "Matrix3", "ModalBody", "ModalNode", "ModalState", "Modes", "Node", "Pid",
    "Planar", "PointMass", "Prismatic", "ProfileSensor", "Pulse", "Quaternion", "Ramp", "Release", "Revolute",
    "RigidBody", "Saturation", "Scene", "SceneEvent", "Screw", "Sensor", "SidBody", "Sine", "SmoothStep", "Spherical",
    "SpinUp", "SpringDamper", "StateSpace", "Table", "TimeSensor", "TipMass", "Universal", "UserLaw", "Vector",
    "Waiver", "Weld", "Wheel",
)  # fmt: skip

_MODULES = {"schema": "flexmb.scene.schema", "scene": "flexmb.scene"}
"""What is no public name but was always there: scripts write `flexmb.schema.Scene`, `flexmb.scene.quaternions`."""

__all__ = [
    "Advice", "Batch", "BatchTrajectory", "Campbell", "ClosureError", "DynamicsError", "EquilibriumError",
    "Evaluation", "EventRecord", "Interrupted", "LinearModel", "PrecisionWarning", "Restart", "RunStage",
    "SceneBuilder", "SceneError", "SceneWarning", "State", "Status", "SteadySpin", "System", "Trajectory", "advise",
    "campbell", "check_scene", "compile", "compile_batch", "equilibrium", "linearize", "load_scene", "no_user_code",
    "open_loop", "save_scene", "simulate", "simulate_batch", "simulate_stages", "steady_spin", "user_function",
    *_OF_SCHEMA,
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        import_module("flexmb.scene.build")  # with it comes the rest of the room
        return import_module(_MODULES[name])
    if name not in __all__:
        raise AttributeError(f"module 'flexmb' has no attribute {name!r}")
    value = getattr(import_module(_LATER.get(name, "flexmb.scene.schema")), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
