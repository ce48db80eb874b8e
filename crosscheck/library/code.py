"""The Python files beside a case or a measured set: closed forms, equations and models, code of whoever wrote them."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from crosscheck.library.case_error import CaseError
from flexmb.scene.user_code import user_code_is_forbidden


def function_of(file: Path, name: str, takes: str, gives: str, named_by: str) -> Callable[..., Any]:
    """The function `name` of a file, which is executed: `executed` and `function_in`."""
    return function_in(executed(file, named_by), file, name, takes, gives)


def executed(file: Path, named_by: str) -> ModuleType:
    """A file as a module; `named_by` says who needs it.

    CaseError names the file: if it is not there, cannot be loaded, or if user code was forbidden.
    """
    if user_code_is_forbidden():
        raise CaseError(f"{file}: it is code, and user code was forbidden: read it, then run without --no-user-code")
    spec = spec_from_file_location(f"{file.stem} of {file.parent.name}", file)
    if spec is None or spec.loader is None or not file.is_file():
        raise CaseError(f"{file}: there is no such Python file, and {named_by}")
    module = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # the file is anybody's
        raise CaseError(f"{file}: it cannot be loaded: {type(error).__name__}: {error}") from None
    return module


def function_in(module: ModuleType, file: Path, name: str, takes: str, gives: str) -> Callable[..., Any]:
    """A function of a module; `takes` and `gives` say what it is given and gives. CaseError if it has none."""
    function: Callable[..., Any] | None = getattr(module, name, None)
    if not callable(function):
        raise CaseError(f"{file}: it has no function {name}({takes}): add one that returns {gives}")
    return function
