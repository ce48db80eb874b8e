"""Processes with their descendants: measuring their memory, and ending them."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterable
from contextlib import suppress
from multiprocessing.process import BaseProcess
from pathlib import Path

import psutil

USABLE = 0.8  # of the memory; the rest is for the system and for the process that runs the workers
CGROUP = Path("/sys/fs/cgroup/memory.max")


def memory_limit(workers: int) -> float:
    """How many bytes each of the `workers` may hold, so that all of them together fit into the memory."""
    total = float(psutil.virtual_memory().total)
    with suppress(OSError, ValueError):  # a container may have less than its machine; "max" means no limit
        total = min(total, float(CGROUP.read_text(encoding="ascii")))
    return USABLE * total / workers


def memory_of(roots: Iterable[int]) -> dict[int, int]:
    """Resident memory in bytes of each process in `roots` together with its descendants."""
    held: dict[int, int] = dict.fromkeys(roots, 0)
    parents = {process.pid: process.info["ppid"] for process in psutil.process_iter(["ppid"])}
    for pid in parents:
        ancestor: int | None = pid
        while ancestor is not None and ancestor not in held:
            ancestor = parents.get(ancestor) or None
        if ancestor is not None:
            with suppress(psutil.Error):
                held[ancestor] += psutil.Process(pid).memory_info().rss
    return held


def end(process: BaseProcess) -> None:
    """Kill a process, its descendants, and its process group where it leads one."""
    assert process.pid is not None
    family: list[psutil.Process] = []
    with suppress(psutil.Error):
        family = psutil.Process(process.pid).children(recursive=True)
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)  # fails if the process did not become a group leader
    for each in family:
        with suppress(psutil.Error):
            each.kill()
    process.kill()
    process.join()
