"""A process that reads mutants one after the other and says what came of each: its death costs one mutant.

It is asked by lines of "kind number" on its input and answers each with a line of JSON.
"""

import json
import os
import resource
import shutil
import signal
import sys
import traceback
import warnings
from pathlib import Path
from random import Random
from typing import Any

from tests.fuzz.kinds import Kind, kinds
from tests.fuzz.mutate import mutant

BAD = ("traceback", "hang", "growth", "wrong accept", "died", "no file named")
BUSY_S = 10.0  # s of processor time, and
ASLEEP_S = 120.0  # s on the clock, which says more of the machine's load: beyond them a reader hangs
GROWTH = 500 * 2**20
CEILING = 3 * 2**30  # of address space beyond what the process has when it starts: it must not take the machine down
PLACES = ("directory", "pipe", "loop", "endless", "missing", "unreadable name")
PLACED = 50  # one mutant in so many is no file at all, but something else in its place


class Hang(BaseException):
    """Raised by the alarm; no reader catches it."""


def main(folder: Path, seed: int, keep: Path) -> None:
    """Answer every line of the input; bad mutants are kept."""
    warnings.simplefilter("ignore")
    found = kinds(folder)
    os.chdir(folder)  # MuJoCo writes a log where it is
    known = set(os.listdir(folder))
    used = _status("VmSize")
    resource.setrlimit(resource.RLIMIT_AS, (used + CEILING, used + CEILING))
    print("ready", flush=True)
    for line in sys.stdin:
        name, _, number = line.strip().rpartition(" ")
        result = _try(found[name], folder, seed, name, int(number), keep)
        print(json.dumps({"kind": name, "number": int(number), **result}), flush=True)
        for leftover in set(os.listdir(folder)) - known:
            _remove(folder / leftover)


def read(kind: Kind, path: Path) -> tuple[str, str]:
    """What comes of reading a file: outcome and detail."""
    _set_alarms(BUSY_S, ASLEEP_S)
    try:
        wrong = kind.accept(path)
        return ("wrong accept", wrong) if wrong else ("accepted", "")
    except Hang:
        return "hang", "".join(traceback.format_exc().splitlines(keepends=True)[-9:])
    except MemoryError:
        return "growth", "MemoryError"
    except (*kind.refusals, OSError) as error:
        return _refusal(kind, path, error)
    except BaseException as error:
        return "traceback", f"{type(error).__name__}: {error!s:.200}\n{traceback.format_exc()[-1500:]}"
    finally:
        _set_alarms(0.0, 0.0)


def content(kind: Kind, name: str, seed: int, number: int) -> tuple[str, bytes | str]:
    """Mutant `number` of a kind: what was done and its bytes, or what stands in the file's place."""
    random = Random(f"{seed} {name} {number}")
    if random.randrange(PLACED) == 0:
        place = random.choice(PLACES)
        return place, place
    return mutant(random, random.choice(kind.seeds), kind.mutations)


def _try(kind: Kind, folder: Path, seed: int, name: str, number: int, keep: Path) -> dict[str, Any]:
    path = folder / kind.file
    done, data = content(kind, name, seed, number)
    backup = path.read_bytes() if path.exists() else None
    _remove(path)
    _place(path, data)
    before = _status("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")  # starts VmHWM anew
    outcome, detail = read(kind, path)
    growth = _status("VmHWM") - before
    if growth > GROWTH:
        outcome, detail = "growth", f"{growth / 2**20:.0f} MB"
    if outcome in BAD:
        _keep(keep / f"{outcome}-{name}-{seed}-{number}-{path.name}".replace(" ", "_"), data, f"{done}\n{detail}\n")
    _remove(path)
    if backup is not None:
        path.write_bytes(backup)
    return {"done": done, "outcome": outcome, "detail": detail, "growth_mb": growth >> 20}


def _refusal(kind: Kind, path: Path, error: BaseException) -> tuple[str, str]:
    """A documented error says which file it is about; any other kind of ValueError came through from below."""
    if not isinstance(error, OSError) and type(error) not in kind.refusals:
        return "traceback", f"{type(error).__name__}: {error}\n{traceback.format_exc()[-1500:]}"
    named = path.name in str(error) or (kind.place and kind.place in str(error))
    return ("refused" if named else "no file named"), f"{error!s:.300}"


def _keep(path: Path, data: bytes | str, why: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.with_name(path.name + ".txt").write_text(why, encoding="utf-8", errors="replace")
    if isinstance(data, bytes):
        path.write_bytes(data)


def _place(path: Path, data: bytes | str) -> None:
    match data:
        case bytes():
            path.write_bytes(data)
        case "directory":
            path.mkdir()
        case "pipe":
            os.mkfifo(path)
        case "loop":
            path.symlink_to(path)
        case "endless":
            path.symlink_to("/dev/zero")
        case "unreadable name":
            path.symlink_to("x" * 250 + "\n")


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _status(field: str) -> int:
    """Bytes of one line of /proc/self/status."""
    for line in Path("/proc/self/status").read_text(encoding="utf-8").splitlines():
        if line.startswith(field + ":"):
            return int(line.split()[1]) * 1024
    raise KeyError(field)


def _set_alarms(busy: float, asleep: float) -> None:
    """Ring after so many seconds of processor time, and on the clock; never after 0."""
    signal.signal(signal.SIGPROF, _ring)
    signal.signal(signal.SIGALRM, _ring)
    signal.setitimer(signal.ITIMER_PROF, busy)
    signal.setitimer(signal.ITIMER_REAL, asleep)


def _ring(number: int, frame: Any) -> None:
    raise Hang


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]))
