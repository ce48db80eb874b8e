"""Whether compiled code may read Python's objects: one switch, and the versions with which that is tested.

`docs/object-access.md` says what is assumed of the interpreter and of numpy, and what it saves.
"""

from __future__ import annotations

import os
import platform
import sys
import sysconfig

import numpy as np

from flexmb.jit.objects import readable

SWITCH = "FLEXMB_READ_OBJECTS"  # of the environment: "auto", which is meant without it, or "off"
PYTHONS = ((3, 11), (3, 12), (3, 13))  # of CPython with its global lock; each has a test
NUMPYS = (2,)


def may_read_objects() -> bool:
    """Whether the versions are tested ones, objects have their words where they are looked for, and nobody forbids it.

    ValueError for a value of FLEXMB_READ_OBJECTS that means nothing.
    """
    match os.environ.get(SWITCH, "auto"):
        case "auto":
            return is_tested() and readable()
        case "off":
            return False
        case other:
            raise ValueError(f'{SWITCH} is {other!r}: use "auto", which is meant if it is not set, or "off"')


def is_tested() -> bool:
    """Whether there is a test for this interpreter and this numpy."""
    has_lock = not sysconfig.get_config_var("Py_GIL_DISABLED")
    is_known = platform.python_implementation() == "CPython" and sys.version_info[:2] in PYTHONS
    return is_known and has_lock and int(np.__version__.split(".")[0]) in NUMPYS
