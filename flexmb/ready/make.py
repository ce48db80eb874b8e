"""Compile general kernels: `python -m flexmb.ready.make FOLDER [--first] [--processor x86-64-v3]`.

Several processes divide the uses of `flexmb.ready.uses` among themselves. Kernels that are already in the folder are
not compiled again; kernels that no use needs any more are deleted. Where no source and no kernel has changed since they
were made, nothing is done. The build hook runs this at installation. It says what it does: a line after every use, and
where there is none for some seconds, how far it is.
"""

from __future__ import annotations

import argparse
import gc
import hashlib
import json
import logging
import multiprocessing
import os
import shutil
import sys
import tempfile
import traceback
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

from flexmb.jit import progress
from flexmb.jit.folder import cache_directory
from flexmb.jit.installed import MADE_BY, described, description
from flexmb.jit.once import compiled_once
from flexmb.output.files import whole_file

KERNELS = "*.kernel"
UNUSED = 0  # modification time that marks unused files; reading a kernel sets another one
SILENCE = 5.0  # s after which a line says how far it is
WORTH_NOTING = 0.1  # s of processor time of a kernel


class Used(NamedTuple):
    """One use: how long it took (s), the traceback of a failure or "", processor time (s) of what it compiled."""

    name: str
    seconds: float
    trouble: str
    spent: dict[str, float]


def make(folder: Path, processes: int, processor: str = "", first: bool = False) -> list[Path]:
    """The kernels in the folder after all uses, for this processor or another one by LLVM's name.

    first: only those of `FIRST`, unless the folder has been filled with all: what it has is renewed. RuntimeError if a
    use has failed, raised after all others have finished and their kernels are in the folder.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with compiled_once(folder / MADE_BY):  # of two simultaneous installations, the second waits and finds the kernels
        first = first and not described(folder).get("whole")
        by = {"whole": not first, "sources": _digest(Path(__file__).parents[1], "*.py")} | _maker(processor)
        if by | {"kernels": _digest(folder, KERNELS)} == _without_seconds(described(folder)):
            _say("no source and no kernel has changed since they were made")
        else:
            _made(folder, processes, processor, by)
        return sorted(folder.glob(KERNELS))


def make_the_rest(processes: int) -> Path:
    """Compile what did not come along with the installation, into the folder of the user, which is returned.

    OSError if there is none that is writable; RuntimeError as for `make`.
    """
    folder = cache_directory()
    if folder is None:
        raise OSError("no folder is writable to keep kernels: set NUMBA_CACHE_DIR to one that is")
    with _environment({}):
        _refuse_failures(_run(_names(first=False), processes, folder))
    return folder


def _digest(folder: Path, pattern: str) -> str:
    """Of names and contents of all files of this pattern below a folder."""
    digest = hashlib.sha256()
    for file in sorted(folder.rglob(pattern)):
        contents = file.read_bytes()
        digest.update(f"{file.relative_to(folder).as_posix()} {len(contents)}\n".encode() + contents)
    return digest.hexdigest()


def _maker(processor: str) -> dict[str, object]:
    """What a process compiles for that begins in the environment of the workers, as it is read from a file."""
    with _environment(_target(processor)), ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        read: dict[str, object] = json.loads(json.dumps(pool.submit(description).result()))
    return read


def _without_seconds(made: dict[str, object]) -> dict[str, object]:
    return {name: value for name, value in made.items() if name != "seconds"}


def _made(folder: Path, processes: int, processor: str, by: dict[str, object]) -> None:
    """Compile what the folder lacks; `by` is what MADE_BY says of it, beside the kernels and their seconds."""
    for file in folder.glob(KERNELS):
        os.utime(file, (UNUSED, UNUSED))
    with tempfile.TemporaryDirectory() as made, _environment({"NUMBA_CACHE_DIR": made} | _target(processor)):
        used = _run(_names(first=not by["whole"]), processes, Path(made))
        for file in Path(made).rglob(KERNELS):
            with whole_file(folder / file.name) as place:
                shutil.copyfile(file, place)
    spent = dict[str, float]()
    for use in used:
        for name, seconds in use.spent.items():
            spent[name] = spent.get(name, 0.0) + seconds
    before = described(folder).get("seconds", {})
    seconds = before | {name: round(found, 1) for name, found in spent.items() if found >= WORTH_NOTING}
    for file in folder.glob(KERNELS):
        if file.stat().st_mtime == UNUSED:
            file.unlink()
    failed = any(use.trouble for use in used)  # then the next installation tries again
    by = by | {"kernels": "" if failed else _digest(folder, KERNELS), "seconds": dict(sorted(seconds.items()))}
    with whole_file(folder / MADE_BY) as place:
        place.write_text(json.dumps(by, indent=1) + "\n", encoding="utf-8")
    _refuse_failures(used)
    print(f"{sum(spent.values()):.0f} s of processor time were spent on kernels", file=sys.stderr)


def _refuse_failures(used: Iterable[Used]) -> None:
    failed = [use.name for use in used if use.trouble]
    if failed:
        raise RuntimeError(f"uses that failed, whose kernels may be missing: {'; '.join(failed)}")


def _run(names: Sequence[str], processes: int, made: Path) -> list[Used]:
    """What the uses of these names have taken; kernels come into `made`."""
    start, used, before = perf_counter(), list[Used](), _kernels(made)
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn"), progress.unheard) as pool:
        left = {pool.submit(_use, name): name for name in names}
        while left:
            done = wait(left, SILENCE, FIRST_COMPLETED).done
            for process in done:
                used.append(_result(process, left.pop(process)))
                name, seconds, trouble, _ = used[-1]
                _say(f"{len(used):3d} of {len(names)}  {seconds:6.1f} s  {name}{trouble}")
            if not done:
                kernels, spent = _kernels(made) - before, perf_counter() - start
                _say(f"{len(used):3d} of {len(names)}  compiling, {kernels} kernels after {spent:.0f} s")
    return used


def _result(done: Future[Used], name: str) -> Used:
    """What a use has given; a process that dies takes all uses with it that were not done."""
    try:
        return done.result()
    except BrokenProcessPool as error:
        return Used(name, 0.0, f"\n{error}", {})


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _kernels(folder: Path) -> int:
    return sum(1 for _ in folder.rglob(KERNELS))


def _target(processor: str) -> dict[str, str]:
    return {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": ""} if processor else {}


@contextmanager
def _environment(more: dict[str, str]) -> Iterator[None]:
    """Set the environment of the processes that are started within; numba reads it when it is imported."""
    before = dict(os.environ)
    os.environ |= {"FLEXMB_KERNELS": "general", "OPENBLAS_NUM_THREADS": "1"} | more
    try:
        yield
    finally:
        os.environ.clear()
        os.environ |= before


def _names(first: bool) -> list[str]:
    """Of the first uses, or of all, in the order in which they are done."""
    from flexmb.ready.uses import FIRST, uses  # it imports numba, which must happen in the environment of the workers

    return list(FIRST) if first else [name for name, _ in uses()]


def _use(name: str) -> Used:
    """Run one use, in a worker process."""
    from flexmb.ready.uses import uses

    start, trouble = perf_counter(), ""
    gc.disable()  # a compiler's objects live on or die by themselves: circles among millions are sought between uses
    logging.getLogger("flexmb.jit").setLevel(logging.ERROR)  # no messages that kernels are being compiled
    progress.spent.clear()
    try:
        dict(uses())[name]()
    except Exception:
        trouble = f"\n{traceback.format_exc()}"
    gc.collect()
    gc.freeze()  # a million objects that live on: the next search passes over them
    return Used(name, perf_counter() - start, trouble, dict(progress.spent))


def at_a_time() -> int:
    """Number of processes: one for each core, and one more where there are several, because one often waits for a
    kernel that another compiles; but with 2.5 GiB of memory each, which compiling may need."""
    cores = os.cpu_count() or 1
    processes = cores + (cores > 1)
    if not hasattr(os, "sysconf"):
        return processes
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return int(max(1, min(processes, memory // (5 * 2**29))))


def main(words: Sequence[str] | None = None) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m flexmb.ready.make", description=__doc__)
    parser.add_argument("folder", type=Path, help="flexmb/ready/kernels of the installation")
    parser.add_argument("--first", action="store_true", help="those that README and canonical need")
    parser.add_argument("--processor", default="", help="LLVM's name of another processor")
    parser.add_argument("--processes", type=int, default=at_a_time())
    asked = parser.parse_args(words)
    start = perf_counter()
    files = make(asked.folder, asked.processes, asked.processor, asked.first)
    size = sum(file.stat().st_size for file in files)
    print(f"{len(files)} kernels, {size / 2**20:.1f} MiB, in {perf_counter() - start:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
