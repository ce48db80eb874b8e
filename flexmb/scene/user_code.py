"""Permission to import the functions that scenes name; by default it is granted.

A law "module:function" of a controller is code, which scenes of unknown origin must not run. `no_user_code` forbids it
within a block of Python; the variable FLEXMB_NO_USER_CODE, which the option --no-user-code of the command lines sets,
forbids it for a process and all processes that it starts.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

VARIABLE = "FLEXMB_NO_USER_CODE"
OWN = "flexmb."  # laws that are part of flexmb are always allowed
_forbidden = ContextVar("user code is forbidden", default=False)


@contextmanager
def no_user_code() -> Iterator[None]:
    """A context in which no function that a scene names is imported: scenes with laws "module:function" are refused by
    a SceneError with the place when they are checked, compiled or run. Laws of flexmb itself are allowed.

        with flexmb.no_user_code():
            scene = flexmb.load_scene("from_a_stranger.toml")
            run = flexmb.simulate(scene, 10.0)

    It applies to the thread that enters it; for a whole process and its workers set FLEXMB_NO_USER_CODE=1.
    """
    before = _forbidden.set(True)
    try:
        yield
    finally:
        _forbidden.reset(before)


def forbid_user_code() -> None:
    """Forbid user code for the rest of this process and for all processes that it starts."""
    os.environ[VARIABLE] = "1"


def user_code_is_forbidden() -> bool:
    """Whether user code is forbidden, by the context or by a value of the variable other than "" and "0"."""
    return _forbidden.get() or os.environ.get(VARIABLE, "0") not in ("", "0")


def refusal(address: str) -> tuple[str, str] | None:
    """Defect and remedy if the law "module:function" may not be imported, else None."""
    if not user_code_is_forbidden() or address.startswith(OWN):
        return None
    remedy = f"read its module, then run without --no-user-code, {VARIABLE} and no_user_code()"
    return f'the function "{address}" is code, and user code was forbidden', remedy
