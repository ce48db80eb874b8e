"""Whether the functions that scenes name may be imported: they may, unless somebody says that they may not.

A law "module:function" of a controller is code. Who reads scenes of others without trusting them forbids it, for a
block of Python by `no_user_code`, for a process and all that it starts by the variable FLEXMB_NO_USER_CODE, which the
option --no-user-code of the command lines sets.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

VARIABLE = "FLEXMB_NO_USER_CODE"
OWN = "flexmb."  # laws that come with flexmb are no code of others
_forbidden = ContextVar("user code is forbidden", default=False)


@contextmanager
def no_user_code() -> Iterator[None]:
    """Within it, nothing that a scene names is imported: scenes with laws "module:function" are refused, by SceneError
    with the place, wherever they are loaded, checked, compiled or run. Laws of flexmb's own are not concerned.

        with flexmb.no_user_code():
            scene = flexmb.load_scene("from_a_stranger.toml")
            run = flexmb.simulate(scene, 10.0)

    It holds in the thread that enters it; for a whole process and its workers set FLEXMB_NO_USER_CODE=1.
    """
    before = _forbidden.set(True)
    try:
        yield
    finally:
        _forbidden.reset(before)


def forbid_user_code() -> None:
    """The same for the rest of this process, and for all that it starts."""
    os.environ[VARIABLE] = "1"


def user_code_is_forbidden() -> bool:
    """Whether one of the two was said; of the variable, anything but nothing and 0."""
    return _forbidden.get() or os.environ.get(VARIABLE, "0") not in ("", "0")


def refusal(address: str) -> tuple[str, str] | None:
    """What is wrong with a law "module:function" and what to do about it, if it may not be imported."""
    if not user_code_is_forbidden() or address.startswith(OWN):
        return None
    remedy = f"read its module, then run without --no-user-code, {VARIABLE} and no_user_code()"
    return f'the function "{address}" is code, and user code was forbidden', remedy
