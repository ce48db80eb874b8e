"""User-defined control laws: functions by name, compiled or plain Python.

    @fm.user_function
    def damper(t, inputs, state, parameters, outputs, change):
        outputs[0] = -parameters[0] * inputs[0]

A compiled law is called from the compiled loop at the cost of a function call; the mechanics is not recompiled. A plain
Python function is called from there too, which takes some microseconds; an exception in it ends the run and is raised
again.
"""

from __future__ import annotations

import ctypes
import inspect
from collections.abc import Callable
from functools import reduce
from importlib import import_module
from typing import Any

from flexmb.control.lookup import fault
from flexmb.jit.foreign import Uncompilable, address_of, as_python, foreign
from flexmb.jit.pointer import REAL, VECTOR, VOID
from flexmb.scene.problems import Defect, Place, SceneError
from flexmb.scene.user_code import refusal
from flexmb.tables.status import INTERRUPTED, OK
from flexmb.typing import Index, Real

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
