"""Measurements that are kept in tests/benchmarks/must_hold/results.json, each with its machine and versions."""

from __future__ import annotations

import os
import platform
import subprocess
from contextlib import suppress
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

import msgspec

from crosscheck.records.machine import processor
from tests.benchmarks.must_hold.row import Measured
from tests.repo.project import ROOT

FILE = Path(__file__).with_name("results.json")
PACKAGES = ("numpy", "scipy", "numba", "llvmlite", "pin", "mujoco", "exudyn")


class Special(msgspec.Struct, frozen=True):
    """The same row by special kernels, and the processor time (s) that these took to compile."""

    measured: Measured
    compiled_s: float


class Kept(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A row's last measurement, or why there is none (`failure`); `commit` has a + where sources were changed.

    kernels: which ones `measured` is of, "auto" for those of the default; what was kept before rows were measured by
    the default has no such entry, and is of special kernels.
    """

    name: str
    date: str
    commit: str
    machine: str
    measured: Measured | None
    failure: str = ""
    kernels: Literal["auto", "special"] = "special"
    special: Special | None = None


class Curve(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Microseconds of one evaluation against a number of bodies or modes, all curves of a picture in turns."""

    label: str
    at: list[int]
    microseconds: list[float]


class Scaling(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The curves of a picture."""

    date: str
    commit: str
    machine: str
    curves: list[Curve]


class Results(msgspec.Struct, forbid_unknown_fields=True):
    """By name of the row and of the picture."""

    rows: dict[str, Kept] = {}
    scaling: dict[str, Scaling] = {}


def read(file: Path = FILE) -> Results:
    """What is kept; nothing where there is no file. Raises msgspec.ValidationError for what is no such file."""
    return msgspec.json.decode(file.read_bytes(), type=Results) if file.exists() else Results()


def write(results: Results, file: Path = FILE) -> None:
    """In the order of names, so that a new measurement of one row is a difference of one row."""
    ordered = Results(dict(sorted(results.rows.items())), dict(sorted(results.scaling.items())))
    file.write_bytes(msgspec.json.format(msgspec.json.encode(ordered), indent=1) + b"\n")


@cache
def this_machine() -> str:
    """Processor, system and versions; packages that are not installed are left out."""
    system = f"{processor()}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}"
    packages = [f"Python {platform.python_version()}"]
    for name in PACKAGES:
        with suppress(PackageNotFoundError):
            packages.append(f"{name} {version(name)}")
    return f"{system}; {', '.join(packages)}"


@cache
def this_commit() -> str:
    """Short name of the commit; with a + where files differ from it, "unknown" outside a checkout."""
    try:
        name = _git("rev-parse", "--short", "HEAD")
        changed = _git("status", "--porcelain", "--", "flexmb", "crosscheck", "tests/benchmarks")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return f"{name}+" if changed else name


def now() -> str:
    """Date of a measurement."""
    return datetime.now(UTC).date().isoformat()


def _git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.strip()
