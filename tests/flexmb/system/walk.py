"""What users can reach: public names, and the classes of all that public calls give and take, by walking along them.

Results are had by calling: `public_calls.calls`. A public method that is found must be among these calls, whose results
are followed in turn.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from functools import cache
from typing import Any

import flexmb as fm
from flexmb.scene import schema
from flexmb.tables.per_thread import Own
from tests.flexmb.system import public_calls

# What is not called here, and why. Whatever else is public must be among the calls.
INSIDE = {  # of the mechanics, for numbers that have been examined
    "nested_system", "precision_if_doubtful", "observe_recursion", "observe_rates", "observe_motion", "observe_row",
    "check_status", "check_precision", "all_loads", "referred_loads", "with_numbers", "fault_name", "turns",
    "refuse_corners", "refuse_undecided", "inverse_at", "by_hinge", "along_hinges", "in_axes",
}  # fmt: skip
UNTRIED = {  # what users may ask all the same: docs/threads.md
    **{f"System.{name}": "makes a new workspace, which is for one thread"
       for name in ("workspace", "recursion_workspace", "composite_workspace")},
    "NestedSystem.workspace": "makes a new workspace, which is for one thread",
    "Parameters.workspace": "makes a new workspace, which is for one thread",
    "Trajectory.plot": "draws by matplotlib, whose figures are for one thread",
    **{f"{each}.plot": "draws by matplotlib, whose figures are for one thread"
       for each in ("Campbell", "SampledModel", "MultiplierMap")},
    "Trajectory.view": "draws: one page at a time is enough",
    "Trajectory.to_rerun": "writes by the library rerun",
}  # fmt: skip
EXEMPT = {
    *UNTRIED,
    *(f"System.{name}" for name in INSIDE),
    "Names.along_hinges",  # of outputs that were found
    "Parameters.arranged",  # of derivatives of runs
    "Batch.tables", "Batch.constants",  # of those who fill lanes
    "open_loop", "user_function", "no_user_code",  # a scene; a function; nothing
    "load_scene", "save_scene", "SceneBuilder",  # files and data, checked where they are compiled
    "ControlledDerivatives", "RunStage", "Restart", "EventRecord",  # what runs are given, or give
    "AccelerationDerivatives", "EvaluationDerivatives", "InverseDynamicsDerivatives",  # results
    "EventSensitivity", "Fit", "Gradient", "Sensitivities", "Uncertainties",  # results
    "FinalValue", "Misfit", "TimeIntegral",  # data, checked by the call of `gradient` and in tests of it
    "Advice", "Campbell", "Evaluation", "LinearModel", "SteadySpin", "System", "Trajectory", "Status",  # results
    "BatchTrajectory", "CriticalPoint", "Envelope", "Equilibrium", "EquilibriumPath", "Extremes",  # results
    "LoopTransfer", "SampledModel", "MultiplierMap",  # results
    "ClosureError", "DynamicsError", "EquilibriumError", "EventError", "Interrupted",
    "NotDifferentiableError", "PrecisionWarning", "SceneError", "SceneWarning",
}  # fmt: skip
INNER = {  # classes of the mechanics and of runs, which users meet only behind what they are given
    "Constraints", "Linearisation",  # of a system
    "Closures", "ClosureConstants", "NestedConstants", "DualConstants", "Constants", "Layout", "Timing", "Integration",
    "BodyLink", "FlexibleNode", "HingeKind", "Models", "Observation", "Settings", "Integrator",
    "Steady", "_Differentiation",  # of parameters
    "Equations", "ClosedEquations", "Pushforward",  # of what derivatives are taken of
    "LiftedLoop",  # of a sampled model, which opens it
    "RunMethod",  # of the advisor's
    "FinalValue",  # data
    "Restart",  # its files: tests/flexmb/run/test_restart.py
}  # fmt: skip
DEEP = 4  # attributes in a row
GUARDED = {  # who holds arrays that kernels write, and why no two threads write them at once
    "Closures": "each thread asks a copy: for_thread",
    "Closed": "held by those above and below",
    "ChainJacobian": "held by those above and below",
    "DerivativeCall": "held by those above and below",
    "AnyBundle": "held by an Integration",
    "Integration": "one run takes it, and the next one makes another",
    "Linear": "held by an Integration",
    "_Careful": "behind a gate, which lets one thread pass",
    "LaneTables": "one run of a batch takes it",
}  # fmt: skip


@cache
def met() -> tuple[Any, ...]:
    """What is asked, what it is given, and what it gives, of every call."""
    found: list[Any] = []
    for call in public_calls.calls().values():
        found += [getattr(call.ask, "__self__", call.ask), call.arguments, call.ask(**call.arguments)]
    return tuple(found)


def reached() -> set[type]:
    """The classes of this library, with public methods, of all that public calls lead to."""
    found: set[type] = set()
    for root in met():
        _follow(root, found, 0)
    return {each for each in found if _methods(each)}


def _follow(thing: Any, found: set[type], depth: int) -> None:
    for each in _parts(thing):
        _follow(each, found, depth)
    kind = type(thing)
    inside = kind.__module__.startswith(("flexmb.scene", "flexmb.jit"))  # data; kernels
    if kind in found or inside or not kind.__module__.startswith("flexmb") or depth > DEEP:
        return
    found.add(kind)
    for name in sorted({*dir(kind), *getattr(thing, "__dict__", ())}):  # in one order, for depth ends the walk
        if not name.startswith("_") and not inspect.isroutine(getattr(kind, name, None)):
            try:
                part = getattr(thing, name)
            except public_calls.DOCUMENTED:
                continue  # what this object has not
            _follow(part, found, depth + 1)


def _parts(thing: Any) -> Iterator[Any]:
    """The first ones of a collection."""
    if type(thing) in (list, tuple) or isinstance(thing, dict):
        yield from list(thing.values() if isinstance(thing, dict) else thing)[:DEEP]


def _methods(kind: type) -> list[str]:
    return [name for name, _ in inspect.getmembers(kind, inspect.isfunction) if not name.startswith("_")]


def public() -> set[str]:
    """Names of everything public that can be called; of a class, and of those that it leads to, its methods too."""
    found = set(fm.__all__) - set(schema.__all__)
    for each in (kind for kind in reached() if kind.__name__ not in INNER):
        found |= {f"{each.__name__}.{name}" for name in _methods(each)}
    return found


def holders() -> set[str]:
    """Classes of what public calls lead to, by any attribute, that hold a workspace which is not of one thread only."""
    found, seen = set[str](), set[int]()
    left: list[tuple[Any, str]] = [(root, "") for root in met()]
    while left:
        thing, holder = left.pop()
        if id(thing) in seen or isinstance(thing, Own):
            continue
        seen.add(id(thing))
        kind = type(thing)
        if isinstance(thing, list | tuple | dict):
            holder = kind.__name__ if hasattr(kind, "_fields") else holder
            left += [(each, holder) for each in (thing.values() if isinstance(thing, dict) else thing)]
        elif kind.__name__.endswith("Workspace"):
            found.add(holder)
        elif kind.__module__.startswith("flexmb"):
            left += [(each, kind.__name__) for each in getattr(thing, "__dict__", {}).values()]
    return found


def unlisted() -> set[str]:
    """Public names that are neither called nor exempt."""
    return public() - EXEMPT - {name.split(",")[0] for name in public_calls.calls()}
