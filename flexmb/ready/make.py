"""Compile all general kernels: `python -m flexmb.ready.make FOLDER [--processor x86-64-v3]`.

Several processes divide the uses of `flexmb.ready.uses` among themselves. Kernels that are already in the folder are
not compiled again; kernels that no use needs any more are deleted. The build hook runs this at installation.
"""

from __future__ import annotations

import argparse
import logging
import multiprocessing
import os
import shutil
import sys
import tempfile
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter

from flexmb.jit.installed import MADE_BY, description
from flexmb.jit.once import compiled_once
from flexmb.output.whole import whole_file

KERNELS = "*.kernel"
UNUSED = 0  # modification time that marks unused files; reading a kernel sets another one


def make(folder: Path, processes: int, processor: str = "") -> list[Path]:
    """The kernels in the folder after all uses, for this processor or another one by LLVM's name.

    RuntimeError if a use has failed, raised after all others have finished and their kernels are in the folder.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with compiled_once(folder / MADE_BY):  # of two simultaneous installations, the second waits and finds the kernels
        return _made(folder, processes, processor)


def _made(folder: Path, processes: int, processor: str) -> list[Path]:
    failed = []
    for file in folder.glob(KERNELS):
        os.utime(file, (UNUSED, UNUSED))
    with tempfile.TemporaryDirectory() as made, _environment(Path(made), processor):
        names = list(_uses())
        with multiprocessing.get_context("spawn").Pool(processes) as pool:
            for done, (name, seconds, trouble) in enumerate(pool.imap_unordered(_use, names), 1):
                print(f"{done:3d} of {len(names)}  {seconds:6.1f} s  {name}{trouble}", file=sys.stderr, flush=True)
                failed += [name] if trouble else []
            text = pool.apply(description)
        for file in Path(made).rglob(KERNELS):
            with whole_file(folder / file.name) as place:
                shutil.copyfile(file, place)
    with whole_file(folder / MADE_BY) as place:
        place.write_text(text, encoding="utf-8")
    for file in folder.glob(KERNELS):
        if file.stat().st_mtime == UNUSED:
            file.unlink()
    if failed:
        raise RuntimeError(f"uses that failed, whose kernels may be missing: {'; '.join(failed)}")
    return sorted(folder.glob(KERNELS))


@contextmanager
def _environment(made: Path, processor: str) -> Iterator[None]:
    """Set the environment of the processes that are started within; numba reads it when it is imported."""
    before = dict(os.environ)
    os.environ |= {"FLEXMB_KERNELS": "general", "NUMBA_CACHE_DIR": str(made), "OPENBLAS_NUM_THREADS": "1"}
    if processor:
        os.environ |= {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": ""}
    try:
        yield
    finally:
        os.environ.clear()
        os.environ |= before


def _uses() -> dict[str, object]:
    from flexmb.ready.uses import uses  # it imports numba, which must happen in the environment of the workers

    return dict(uses())


def _use(name: str) -> tuple[str, float, str]:
    """Run one use, in a worker process; returns its name, the time (s), and the traceback of a failure or ""."""
    start = perf_counter()
    logging.getLogger("flexmb.jit").setLevel(logging.ERROR)  # no messages that kernels are being compiled
    try:
        _uses()[name]()
    except Exception:
        return name, perf_counter() - start, f"\n{traceback.format_exc()}"
    return name, perf_counter() - start, ""


def _at_a_time() -> int:
    """Number of processes: one for each core, but with 2 GiB of memory each, which compiling may need."""
    cores = os.cpu_count() or 1
    if not hasattr(os, "sysconf"):
        return cores
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return int(max(1, min(cores, memory // 2**31)))


def main(words: Sequence[str] | None = None) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m flexmb.ready.make", description=__doc__)
    parser.add_argument("folder", type=Path, help="flexmb/ready/kernels of the installation")
    parser.add_argument("--processor", default="", help="LLVM's name of another processor")
    parser.add_argument("--processes", type=int, default=_at_a_time())
    asked = parser.parse_args(words)
    start = perf_counter()
    files = make(asked.folder, asked.processes, asked.processor)
    size = sum(file.stat().st_size for file in files)
    print(f"{len(files)} kernels, {size / 2**20:.1f} MiB, in {perf_counter() - start:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
