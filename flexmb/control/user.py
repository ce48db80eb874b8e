"""User-defined control laws: functions by name, compiled or plain Python.

    @fm.user_function
    def damper(t, inputs, state, parameters, outputs, change):
        outputs[0] = -parameters[0] * inputs[0]

A compiled law is called from the compiled loop at the cost of a function call; the mechanics is not recompiled. A plain
Python function is called from there too, which takes some microseconds; an exception in it ends the run and is raised
again.

The name of a law, "module:function", is checked in the source of its module, since importing a module executes it. Only
definite faults are reported. Modules without source (compiled, built in), and names that are bound otherwise than by
`def`, are left to the import.
"""

from __future__ import annotations

import ast
import ctypes
import inspect
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from importlib import import_module
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any

from flexmb.jit.foreign import Uncompilable, address_of, as_python, foreign
from flexmb.jit.pointer import REAL, VECTOR, VOID
from flexmb.scene.problems import Defect, Place, SceneError
from flexmb.scene.user_code import refusal
from flexmb.tables.status import INTERRUPTED, OK
from flexmb.typing import Index, Real

BOUND_BY_HAND = ("globals", "exec", "setattr", "vars", "locals")  # calls that bind names dynamically
DEEPEST = 8  # limit of successive re-exports of a name


def fault(module: str, name: str, arguments: int, depth: int = 0) -> str | None:
    """Why "module:name" cannot be a function of that many arguments, by its source; None if that cannot be told."""
    if module in sys.modules:
        return None  # already imported: another import executes nothing
    found = _spec(module)
    if found is None:
        return f"No module named {module!r}"
    tree = _parsed(found)
    if tree is None or _makes_names(tree):
        return None
    first, _, inner = name.partition(".")
    bindings = list(_bindings(tree.body, first))
    if not bindings:
        return f"module {module!r} has no attribute {first!r}"
    last = bindings[-1]
    match last:
        case ast.FunctionDef() if not inner and len(bindings) == 1 and not _replaced(last):
            return None if _takes(last.args, arguments) else f"it does not take {arguments} arguments"
        case ast.AsyncFunctionDef():
            return "it is asynchronous"
        case ast.Import() if not inner:
            return "it is a module"
        case ast.ImportFrom(module=str(other), level=0) if len(bindings) == 1 and depth < DEEPEST:
            true = next(name.name for name in last.names if (name.asname or name.name) == first)
            return None if inner else fault(other, true, arguments, depth + 1)
    return None


def _spec(module: str) -> ModuleSpec | None:
    """Search along sys.path as Python does, but without importing parent packages."""
    path: Sequence[str] | None = None
    parts, found = module.split("."), None
    for count in range(1, len(parts) + 1):
        full = ".".join(parts[:count])
        loaded = getattr(sys.modules.get(full), "__spec__", None)
        found = loaded or _searched(full, path)
        if found is None:
            return None
        path = list(found.submodule_search_locations or ())
        if count < len(parts) and found.submodule_search_locations is None:
            return None
    return found


def _searched(module: str, path: Sequence[str] | None) -> ModuleSpec | None:
    for finder in sys.meta_path:
        if found := getattr(finder, "find_spec", lambda *_: None)(module, path, None):
            return found
    return None


def _parsed(spec: ModuleSpec) -> ast.Module | None:
    if not spec.has_location or spec.origin is None or Path(spec.origin).suffix != ".py":
        return None
    try:
        return ast.parse(Path(spec.origin).read_bytes())
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError):
        return None  # the import gives a better message


def _makes_names(tree: ast.Module) -> bool:
    """Whether names may be bound dynamically: `from m import *`, `__getattr__`, `globals()`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and any(name.name == "*" for name in node.names):
            return True
        if isinstance(node, ast.FunctionDef) and node.name == "__getattr__":
            return True
        if isinstance(node, ast.Name) and node.id in BOUND_BY_HAND:
            return True
    return False


def _bindings(body: Sequence[ast.stmt], name: str) -> Iterator[ast.stmt]:
    """The statements at module level, also inside branches and blocks, that bind a name."""
    for statement in body:
        match statement:
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                if statement.name == name:
                    yield statement
                continue
            case ast.Import() | ast.ImportFrom():
                if any((alias.asname or alias.name.partition(".")[0]) == name for alias in statement.names):
                    yield statement
                continue
        inner = [block for key in ("body", "orelse", "finalbody") for block in getattr(statement, key, ())]
        inner += [line for handler in getattr(statement, "handlers", ()) for line in handler.body]
        inner += [line for case in getattr(statement, "cases", ()) for line in case.body]
        yield from _bindings(inner, name)
        if any(_binds(node, name) for node in ast.walk(statement)):
            yield statement


def _binds(node: ast.AST, name: str) -> bool:
    return isinstance(node, ast.Name) and node.id == name and not isinstance(node.ctx, ast.Load)


def _replaced(function: ast.FunctionDef) -> bool:
    """Whether a decorator may replace the function; flexmb's own decorator keeps the arguments."""
    names = {ast.unparse(decorator).rpartition(".")[2] for decorator in function.decorator_list}
    return bool(names - {"user_function"})


def _takes(arguments: ast.arguments, count: int) -> bool:
    most = len(arguments.posonlyargs) + len(arguments.args)
    least = most - len(arguments.defaults)
    required = any(default is None for default in arguments.kw_defaults)
    return least <= count and (count <= most or arguments.vararg is not None) and not required


ARGUMENTS = ("t", "inputs", "state", "parameters", "outputs", "change")

_callback = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_double)


def user_function(law: Callable[..., None]) -> Any:
    """Mark law(t, inputs, state, parameters, outputs, change) to be compiled; a decorator.

    t is the time (s); the other arguments are arrays of floats: the inputs of the controller, its state, `parameters`,
    and `outputs` and `change`, which the law writes. `change` holds the rates of the state or, if the controller has a
    period, the next state. The law must be compilable by numba and returns nothing. Errors are not raised in compiled
    code: a number that is not finite ends the run.
    """
    return foreign(law)


def found(address: str, scene: str, place: Place) -> Any:
    """The function "module:name"; SceneError if it cannot be imported, takes other arguments, or is forbidden.

    Since importing a module executes it, faults that its source shows are reported before the import.
    """
    if forbidden := refusal(address):
        raise SceneError(scene, [Defect(str(place), *forbidden)])
    module, _, name = address.partition(":")
    remedy = "it is looked for where Python imports from: give its module's folder in PYTHONPATH, or mend the name"
    if reason := fault(module, name, len(ARGUMENTS)):
        what = f'the function "{address}" cannot be imported as one of ({", ".join(ARGUMENTS)}): {reason}'
        raise SceneError(scene, [Defect(str(place), what, remedy)])
    try:
        law = reduce(getattr, name.split("."), import_module(module))
    except (KeyboardInterrupt, SceneError):
        raise
    except BaseException as error:  # imported modules may raise anything, SystemExit included
        what = f'the function "{address}" cannot be imported: {type(error).__name__}: {error}'
        raise SceneError(scene, [Defect(str(place), what, remedy)]) from error
    plain = as_python(law)
    if not callable(plain) or not _takes_six(plain):
        what = f'"{address}" is no function of ({", ".join(ARGUMENTS)})'
        raise SceneError(scene, [Defect(str(place), what, "write one of these six arguments")])
    return law


def _takes_six(function: Callable[..., Any]) -> bool:
    try:
        inspect.signature(function).bind(*ARGUMENTS)
    except (TypeError, ValueError):
        return False
    return True


def compiled_address(law: Any, scene: str, place: Place) -> int:
    """The address of a compiled law; SceneError with numba's message if it cannot be compiled."""
    try:
        return address_of(law, VOID, REAL, *[VECTOR] * 5)
    except Uncompilable as error:
        remedy = "take numba's advice, or leave the decorator out: a plain function runs, slower"
        what = f'"{as_python(law).__name__}" cannot be compiled: {error}'
        raise SceneError(scene, [Defect(str(place), what, remedy)]) from error


class Called:
    """A plain Python law that compiled code can call; `trouble` is the exception that it raised."""

    def __init__(self, law: Callable[..., None], arrays: tuple[Real, ...]) -> None:
        self._law, self._arrays = law, arrays
        self._entry = _callback(self._call)
        self.trouble: BaseException | None = None
        self.stop: Index | None = None
        """(1,) of the run, set to 1 to end it."""

    @property
    def address(self) -> int:
        """The address for compiled code, valid as long as this object exists."""
        return ctypes.cast(self._entry, ctypes.c_void_p).value or 0

    def _call(self, t: float) -> int:
        if self.trouble is None:
            try:
                self._law(t, *self._arrays)
            except BaseException as trouble:
                self.trouble = trouble
            else:
                return OK
        if self.stop is not None:
            self.stop[0] = 1
        return INTERRUPTED
