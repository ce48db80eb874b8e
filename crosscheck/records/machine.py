"""The first record of every session: the machine and the versions of the software."""

from __future__ import annotations

import os
import platform
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from crosscheck.library.own_files import code_here
from crosscheck.records.kinds import Environment

PACKAGES = ("flexmb", "numpy", "scipy", "numba", "msgspec")


def environment(cases: tuple[str, ...] = (), engines: tuple[str, ...] = (), confirms: bool = False) -> Environment:
    """This machine, the versions of the software, and what was asked for."""
    return Environment(
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        python=platform.python_version(),
        system=f"{platform.system()} {platform.release()} ({platform.machine()})",
        processor=processor(),
        cores=os.cpu_count() or 1,
        packages={name: _package_version(name) for name in PACKAGES},
        cases=cases,
        engines=engines,
        confirms=confirms,
        code=code_here(),
    )


def _package_version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def processor() -> str:
    """Model name of the CPU: Linux keeps it in /proc/cpuinfo, elsewhere `platform` knows it."""
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
