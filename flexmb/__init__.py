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

if TYPE_CHECKING:  # under the names that they are exported by
    from flexmb.advisor.advice import Advice as Advice
    from flexmb.advisor.advice import advise as advise
    from flexmb.closure.closures import ClosureError as ClosureError
    from flexmb.control.user import user_function as user_function
    from flexmb.linear.campbell import Campbell as Campbell
    from flexmb.linear.campbell import campbell as campbell
    from flexmb.linear.equilibrium import EquilibriumError as EquilibriumError
    from flexmb.linear.equilibrium import equilibrium as equilibrium
    from flexmb.linear.linear_model import LinearModel as LinearModel
    from flexmb.linear.linearize import linearize as linearize
    from flexmb.linear.spin import SteadySpin as SteadySpin
    from flexmb.linear.spin import steady_spin as steady_spin
    from flexmb.run.batch_trajectory import BatchTrajectory as BatchTrajectory
    from flexmb.run.interruption import Interrupted as Interrupted
    from flexmb.run.restart import Restart as Restart
    from flexmb.run.simulate import simulate as simulate
    from flexmb.run.simulate_batch import simulate_batch as simulate_batch
    from flexmb.run.situation import EventRecord as EventRecord
    from flexmb.run.stages import RunStage as RunStage
    from flexmb.run.stages import simulate_stages as simulate_stages
    from flexmb.run.trajectory import Trajectory as Trajectory
    from flexmb.scene import schema as schema
    from flexmb.scene.build import SceneBuilder as SceneBuilder
    from flexmb.scene.check import SceneError as SceneError
    from flexmb.scene.check import SceneWarning as SceneWarning
    from flexmb.scene.check import check_scene as check_scene
    from flexmb.scene.connectors import *  # noqa: F403  (the schema's names are part of this API)
    from flexmb.scene.files import load_scene as load_scene
    from flexmb.scene.files import save_scene as save_scene
    from flexmb.scene.hinges import *  # noqa: F403
    from flexmb.scene.open_loop import open_loop as open_loop
    from flexmb.scene.schema import *  # noqa: F403
    from flexmb.scene.user_code import no_user_code as no_user_code
    from flexmb.system.batch import Batch as Batch
    from flexmb.system.batch import compile_batch as compile_batch
    from flexmb.system.compile import compile as compile
    from flexmb.system.observables import Evaluation as Evaluation
    from flexmb.system.tree_system import System as System
    from flexmb.tables.state import DynamicsError as DynamicsError
    from flexmb.tables.state import PrecisionWarning as PrecisionWarning
    from flexmb.tables.state import State as State
    from flexmb.tables.status import Status as Status

_LATER = {
    "Advice": "flexmb.advisor.advice",
    "advise": "flexmb.advisor.advice",
    "Campbell": "flexmb.linear.campbell",
    "campbell": "flexmb.linear.campbell",
    "ClosureError": "flexmb.closure.closures",
    "equilibrium": "flexmb.linear.equilibrium",
    "EquilibriumError": "flexmb.linear.equilibrium",
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
    "compile_batch": "flexmb.system.batch",
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

_MODULES = {"schema": "flexmb.scene.schema", "scene": "flexmb.scene"}
"""What is no public name but was always there: scripts write `flexmb.schema.Scene`, `flexmb.scene.quaternions`."""


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        import_module("flexmb.scene.build")  # with it comes the rest of the room
        return import_module(_MODULES[name])
    if name == "__all__":
        return sorted([*_LATER, *import_module("flexmb.scene.schema").__all__])
    if name not in _LATER and (name.startswith("_") or name not in import_module("flexmb.scene.schema").__all__):
        raise AttributeError(f"module 'flexmb' has no attribute {name!r}")
    value = getattr(import_module(_LATER.get(name, "flexmb.scene.schema")), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__getattr__("__all__")})
