"""How long a newcomer waits: the README's example, the canonical cases, whatever starts; in processes of their own.

All are judged by their processor time, which is what they take on the wall where nobody else is at work, but for the
canonical cases, whose work is spread over processes, by the wall. What a start loads is held by tests/repo/test_starts.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import NamedTuple

from tests.benchmarks.must_hold.row import Measured, Row
from tests.repo.project import ROOT

GROUP = "Start"
COLD_ROUNDS, WARM_ROUNDS = 2, 5
SHORT_ROUNDS = 15  # of a fraction of a second each


class Spent(NamedTuple):
    """Seconds of a process and its children: user and system time, and on the wall."""

    processor: float
    wall: float


def rows() -> list[Row]:
    """Cold: nothing compiled beside what came with the installation. Warm: every kernel on disk."""
    return [
        Row("readme_cold", GROUP, "README's first example, cold", 3.0, partial(_readme, True), "at most", "s"),
        Row("readme_warm", GROUP, "README's first example, warm", 1.2, partial(_readme, False), "at most", "s"),
        Row("canonical_cold", GROUP, "crosscheck run canonical, cold", 90.0, partial(_canonical, True), "at most", "s"),
        Row("canonical", GROUP, "crosscheck run canonical, warm", 75.0, partial(_canonical, False), "at most", "s"),
        *(
            Row(name, GROUP, what, goal, partial(_start, code, *words), "at most", "s")
            for name, what, goal, code, *words in (
                ("import_flexmb", "import flexmb", 0.25, "import flexmb"),
                ("flexmb_help", "flexmb --help", 0.3, "from flexmb.cli import main; main()", "--help"),
                ("crosscheck_help", "crosscheck --help", 0.3, "from crosscheck.__main__ import main; main()", "--help"),
            )
        ),
        Row("plug_in", GROUP, "pytest session, what the plug-in adds where nobody asks", 0.1, _plug_in, "at most", "s"),
    ]


def _readme(cold: bool) -> Measured:
    """As a process of its own, imports included."""
    example = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.DOTALL)[0]
    command = [sys.executable, "-c", example]
    with tempfile.TemporaryDirectory() as folder:
        if not cold:
            run(command, Path(folder))
        rounds = COLD_ROUNDS if cold else WARM_ROUNDS
        spent = [run(command, Path(folder) / f"{k}" if cold else Path(folder)) for k in range(rounds)]
    seconds = [each.processor for each in spent]
    wall = f"processor time; {median(each.wall for each in spent):.3g} s on the wall"
    return Measured(median(seconds), min(seconds), max(seconds), wall)


def _canonical(cold: bool) -> Measured:
    """With a worker for each processor, as the command does by itself."""
    with tempfile.TemporaryDirectory() as folder:
        if not cold:
            run(crosscheck(Path(folder) / "before"), Path(folder) / "kernels")
        spent = run(crosscheck(Path(folder) / "out"), Path(folder) / "kernels")
    detail = f"on the wall; {spent.processor:.3g} s of {os.cpu_count()} processors"
    return Measured(spent.wall, spent.wall, spent.wall, detail)


def _start(code: str, *words: str) -> Measured:
    """Python's own start included, and the bytecode there."""
    command = [sys.executable, "-c", code, *words]
    run(command)
    spent = [run(command) for _ in range(SHORT_ROUNDS)]
    seconds = [each.processor for each in spent]
    wall = f"processor time; {median(each.wall for each in spent):.3g} s on the wall"
    return Measured(median(seconds), min(seconds), max(seconds), wall)


def _plug_in() -> Measured:
    """Sessions of one empty test with the plug-in, less those without, in turns; no other plug-in takes part."""
    with tempfile.TemporaryDirectory() as folder:
        test, configuration = Path(folder) / "test_theirs.py", Path(folder) / "pytest.ini"
        test.write_text("def test_theirs():\n    pass\n", encoding="utf-8")
        configuration.write_text("[pytest]\n", encoding="utf-8")
        session = [sys.executable, "-m", "pytest", "-c", str(configuration), "--rootdir", folder, str(test)]

        def seconds(*words: str) -> float:
            return run([*session, *words], PYTEST_DISABLE_PLUGIN_AUTOLOAD="1", PYTEST_ADDOPTS="").processor

        seconds("-p", "crosscheck.pytest_plugin")
        pairs = [(seconds("-p", "crosscheck.pytest_plugin"), seconds()) for _ in range(SHORT_ROUNDS)]
    more = [with_it - without for with_it, without in pairs]
    sessions = " against ".join(f"{median(times):.3g} s" for times in zip(*pairs, strict=True))
    return Measured(median(more), min(more), max(more), f"processor time; {sessions}")


def crosscheck(out: Path, *options: str) -> Sequence[str]:
    """The command that runs the canonical cases."""
    main = "from crosscheck.cli import main; main()"
    return [sys.executable, "-c", main, "run", "canonical", "--out", str(out), *options]


def run(command: Sequence[str], kernels: Path | None = None, **variables: str) -> Spent:
    """A process in the root of the repository, with its own folder of kernels, unless it is to use that of the user.

    variables: of its environment, beside those of this process.

    It keeps the bytecode of what it imports, as Python does by itself, whatever the environment of the benchmarks says:
    a process that parses all sources anew is no second one.
    Raises CalledProcessError where it fails; what it printed is part of it.
    """
    from resource import RUSAGE_CHILDREN, getrusage  # Unix only, as most peers are

    environment = os.environ | {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"} | variables
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    if "FLEXMB_KERNELS" not in variables:  # as a user has it, whatever the other rows ask for
        environment.pop("FLEXMB_KERNELS", None)
    if kernels is not None:
        environment["NUMBA_CACHE_DIR"] = str(kernels)
    before, start = getrusage(RUSAGE_CHILDREN), perf_counter()
    subprocess.run(command, cwd=ROOT, env=environment, check=True, capture_output=True, text=True)
    wall, after = perf_counter() - start, getrusage(RUSAGE_CHILDREN)
    return Spent(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, wall)
