"""Kernels that were compiled when flexmb was installed: their folder, and whether this process can use them.

Each is found by its own key (cache.py), so that only kernels that fit are loaded. Here it is determined in advance
whether all of them were made for another numba or another processor, and therefore cannot be used.
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
    """The folder of installed kernels; None if there is none."""
    here = globals().get("__file__")  # modules that a frozen program loads from its archive have none
    folder = Path(here).parents[1] / "ready" / "kernels" if here else None
    return folder if folder and folder.is_dir() else None


@cache
def unfit() -> str:
    """Why this process cannot use the installed kernels; an empty string if it can."""
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
    """The versions and the processor for which this process compiles, for the file MADE_BY beside its kernels."""
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
