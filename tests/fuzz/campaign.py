"""A campaign: so many mutants, shared among the kinds, read by worker processes that may die."""

import json
import select
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

from tests.fuzz.kinds import kinds
from tests.fuzz.worker import ASLEEP_S, BAD

SHARES = {  # of the others one each
    "scene": 6, "run file": 4, "verify csv": 5, "npz": 4, "records": 4, "mjcf": 3, "urdf": 3, "sid": 3, "sweep": 3,
}  # fmt: skip
GRACE_S = 30.0  # beyond the alarm, which compiled code does not hear
START_S = 600.0  # a busy machine included


def campaign(mutants: int, seed: int, workers: int, keep: Path, only: str = "") -> list[dict[str, Any]]:
    """Results of all mutants: kind, number, done, outcome, detail, growth_mb. Bad mutants are kept in `keep`."""
    with tempfile.TemporaryDirectory() as folder:
        names = [name for name in kinds(Path(folder) / "names") if not only or name == only]
        shares = [name for name in names for _ in range(SHARES.get(name, 1))]
        asked = [(shares[i % len(shares)], i) for i in range(mutants)]
        with ThreadPoolExecutor(workers) as pool:
            parts = pool.map(lambda k: _work(Path(folder) / str(k), seed, keep, asked[k::workers]), range(workers))
            return [result for part in parts for result in part]


def table(results: list[dict[str, Any]]) -> str:
    """Counts by kind and outcome."""
    outcomes = ["refused", "accepted", *BAD]
    rows = [("", *outcomes)]
    for kind in (*dict.fromkeys(result["kind"] for result in results), "all"):
        counts = Counter(result["outcome"] for result in results if kind in (result["kind"], "all"))
        rows.append((kind, *(str(counts[outcome]) for outcome in outcomes)))
    return "\n".join(f"{row[0]:14s}" + "".join(f"{cell:>14s}" for cell in row[1:]) for row in rows)


def _work(folder: Path, seed: int, keep: Path, asked: list[tuple[str, int]]) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    worker = None
    for name, number in asked:
        worker = worker or _start(folder, seed, keep)
        answer = _ask(worker, f"{name} {number}\n")
        if not answer:
            worker.kill()
            _end(worker)
            worker = None
            died = f"no answer: mutant {number} of {name}, seed {seed}, which `tests.fuzz.worker.content` makes again"
            print(died, flush=True)
            answer = json.dumps({"kind": name, "number": number, "done": "", "outcome": "died", "detail": died})
        found.append(json.loads(answer))
    if worker is not None:
        _end(worker)
    return found


def _start(folder: Path, seed: int, keep: Path) -> Any:
    worker = subprocess.Popen(
        [sys.executable, "-m", "tests.fuzz.worker", str(folder), str(seed), str(keep)],
        cwd=Path(__file__).resolve().parents[2], text=True, bufsize=1,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    if not _wait(worker, START_S):
        raise RuntimeError("the worker does not start: run python -m tests.fuzz.worker to see why")
    return worker


def _end(worker: Any) -> None:
    """Close its pipes, at which it ends, and wait until it has."""
    with suppress(BrokenPipeError), worker:
        pass


def _ask(worker: Any, line: str) -> str:
    try:
        worker.stdin.write(line)
        return _wait(worker, ASLEEP_S + GRACE_S)
    except BrokenPipeError:
        return ""


def _wait(worker: Any, limit_s: float) -> str:
    ready, _, _ = select.select([worker.stdout], [], [], limit_s)
    return worker.stdout.readline() if ready else ""
