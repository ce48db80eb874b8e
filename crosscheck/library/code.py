"""The Python files beside a case or a measured set: closed forms, equations and models, code of whoever wrote them."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from crosscheck.library.case_error import CaseError
from flexmb.scene.user_code import user_code_is_forbidden


def function_of(file: Path, name: str, takes: str, gives: str, named_by: str) -> Callable[..., Any]:
    """The function `name` of a file, which is executed.

    `takes` and `gives` say what the function is given and gives, and `named_by` who needs the file. CaseError names the
    file: if it is not there, cannot be loaded, has no such function, or if user code was forbidden.
    """
    if user_code_is_forbidden():
        raise CaseError(f"{file}: it is code, and user code was forbidden: read it, then run without --no-user-code")
    spec = spec_from_file_location(f"{name} of {file.parent.name}", file)
    if spec is None or spec.loader is None or not file.is_file():
        raise CaseError(f"{file}: there is no such Python file, and {named_by}")
    module = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # the file is anybody's
        raise CaseError(f"{file}: it cannot be loaded: {type(error).__name__}: {error}") from None
    function: Callable[..., Any] | None = getattr(module, name, None)
    if not callable(function):
        raise CaseError(f"{file}: it has no function {name}({takes}): add one that returns {gives}")
    return function
