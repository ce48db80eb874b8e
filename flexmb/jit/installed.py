"""Kernels that were compiled when flexmb was installed: where they are, and whether they are for this process.

Each is found by a key of its own (cache.py), so that none that does not fit is ever taken. What is told here is the
same of all together, before any is asked for: kernels of another numba or for another processor are of no use.
"""

from __future__ import annotations

import json
import platform
from functools import cache
from pathlib import Path

import llvmlite
import numba
import numpy

from flexmb.jit.fingerprint import compiler
from flexmb.jit.processors import compiled_for, running

MADE_BY = "made.json"


@cache
def installed_directory() -> Path | None:
    """Where they are; None where there are none."""
    here = globals().get("__file__")  # what a frozen program loads out of its archive has none
    folder = Path(here).parents[1] / "ready" / "kernels" if here else None
    return folder if folder and folder.is_dir() else None


@cache
def unfit() -> str:
    """Why they are of no use in this process; nothing where they are."""
    folder = installed_directory()
    try:
        made = json.loads((folder / MADE_BY).read_text(encoding="utf-8")) if folder else None
    except (OSError, ValueError):
        made = None
    if not (isinstance(made, dict) and isinstance(made.get("versions"), dict)):
        return "no kernels came with the installation"
    now = _maker()
    for name, version in now["versions"].items():
        if made["versions"].get(name) != version:
            before = made["versions"].get(name, "(unknown)")
            return f"those that came with the installation are for {name} {before}, and this is {version}"
    if made.get("processor") not in map(list, running(_codegen())):
        return "those that came with the installation are for another processor"
    if made.get("compiler") != now["compiler"]:
        return "flexmb/jit has changed since those of the installation were compiled"
    return ""


def description() -> str:
    """What this process compiles with, for the file MADE_BY beside its kernels."""
    return json.dumps(_maker() | {"processor": compiled_for(_codegen())}, indent=1) + "\n"


def _maker() -> dict[str, object]:
    versions = {
        "Python": ".".join(platform.python_version_tuple()[:2]), "numba": numba.__version__,
        "llvmlite": llvmlite.__version__, "NumPy": numpy.__version__,
    }  # fmt: skip
    return {"versions": versions, "compiler": compiler().hex()}


def _codegen() -> object:
    from numba.core.registry import cpu_target

    return cpu_target.target_context.codegen()
