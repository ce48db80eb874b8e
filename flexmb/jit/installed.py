"""Kernels that were compiled when flexmb was installed: their folder, and whether this process can use them.

Each is found by its own key (cache.py), so that only kernels that fit are loaded. Here it is determined in advance
whether all of them were made for another numba or another processor, and therefore cannot be used.
"""

from __future__ import annotations

import json
import platform
from functools import cache
from pathlib import Path
from typing import Any

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
    made = described(folder) if folder else {}
    if not isinstance(made.get("versions"), dict):
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


@cache
def is_whole() -> bool:
    """Whether all general kernels came with the installation and fit, not only those that are needed first."""
    folder = installed_directory()
    return folder is not None and not unfit() and described(folder).get("whole") is True


def described(folder: Path) -> dict[str, Any]:
    """What the file MADE_BY says of the kernels in a folder; nothing where there is none that can be read."""
    try:
        made = json.loads((folder / MADE_BY).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return made if isinstance(made, dict) else {}


def description() -> dict[str, object]:
    """The versions and the processor for which this process compiles, for the file MADE_BY beside its kernels."""
    return _maker() | {"processor": compiled_for(_codegen())}


def _maker() -> dict[str, Any]:
    versions = {
        "Python": ".".join(platform.python_version_tuple()[:2]), "numba": numba.__version__,
        "llvmlite": llvmlite.__version__, "NumPy": numpy.__version__,
    }  # fmt: skip
    return {"versions": versions, "compiler": compiler().hex()}


def _codegen() -> object:
    from numba.core.registry import cpu_target

    return cpu_target.target_context.codegen()
