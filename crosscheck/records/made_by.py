"""The key of what made a result: a recorded result is reused as long as the key of the present sources is the same.

The key is a digest of all source files that can take part (`sources`), of the versions and contents of the libraries
that these require, directly or not, and of the compiler's settings, Python and the machine. Scene, sample times and
effort are fields of the record itself. A changed comment changes the key too: running again is cheaper than a stale
result.
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import sys
from collections.abc import Iterable
from functools import cache
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from crosscheck.records.machine import processor
from crosscheck.records.sources import owner, sources

# The modules of the harness that determine recorded numbers; those that they import do not.
RECORDING = (
    "crosscheck.running.execute",
    "crosscheck.running.rung",
    "crosscheck.running.moved",
    "crosscheck.engines.checked",
    "crosscheck.engines.answers",
    "crosscheck.engines.contract",
    "crosscheck.engines.linear.outputs",
    "crosscheck.engines.total_loads",
    "crosscheck.engines.trajectories",
    "crosscheck.records.kinds",
    "crosscheck.records.packing",
    "crosscheck.records.archive",
    "flexmb.run.channels",
)


def made_by(modules: Iterable[str], recording: Iterable[str] = RECORDING) -> str:
    """The key of results that `modules` compute and that the modules `recording` check and store."""
    return _key(frozenset(modules), frozenset(recording))


@cache
def _key(modules: frozenset[str], recording: frozenset[str]) -> str:
    files = sources(modules, recording)
    digest = hashlib.sha256()
    for module, file in sorted(files.files.items()):
        digest.update(f"{module} {_text(file)}\n".encode())
    for library in sorted(files.libraries):
        digest.update(f"{library} {_library(library)}\n".encode())
    digest.update(_machine().encode())
    return digest.hexdigest()[:16]


@cache  # read once: later edits of the files are not what this process has loaded
def _text(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


@cache
def _library(top: str) -> str:
    """Versions and contents of the distribution of a library and of all that it requires."""
    first = owner(top)
    if first is None:
        return "not installed"
    distributions: dict[str, Distribution] = {}
    waiting = [first]
    while waiting:
        module = waiting.pop()
        if module.name not in distributions:
            distributions[module.name] = module
            waiting.extend(_required(module))
    return ", ".join(_content(distributions[name]) for name in sorted(distributions))


def _required(library: Distribution) -> list[Distribution]:
    """Installed distributions that one requires, extras left out."""
    names = [re.split(r"[^\w.-]", text, maxsplit=1)[0] for text in library.requires or () if "extra ==" not in text]
    libraries = []
    for name in names:
        try:
            libraries.append(distribution(name))
        except PackageNotFoundError:  # required on other platforms
            continue
    return libraries


def _content(library: Distribution) -> str:
    """Version and digest of the list of its files with their digests: builds of the same version differ in it."""
    record = library.read_text("RECORD") or ""
    return f"{library.name} {library.version} {hashlib.sha256(record.encode()).hexdigest()[:16]}"


@cache
def _machine() -> str:
    compiler = {name: text for name, text in os.environ.items() if name.startswith("NUMBA_")}
    compiler.pop("NUMBA_CACHE_DIR", None)
    place = (platform.system(), platform.machine(), *platform.libc_ver(), processor())
    return f"{sys.version} {place} {sorted(compiler.items())}"
