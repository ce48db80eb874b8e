"""First uses of scenes in processes of their own, with no kernels but those that came with the installation.

Processor time of the whole process, imports included, as a user waits for it.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import tomllib
from functools import cache, partial
from pathlib import Path
from statistics import median
from typing import Literal

from tests.benchmarks.must_hold.row import Measured, Row
from tests.benchmarks.must_hold.start import run
from tests.repo.project import ROOT

GROUP = "First uses"
SATELLITE = "spacecraft/deploy_and_slew"
BEAM = "spinning_beam/beam_k_subcritical"
ROUNDS = 3
Statistic = Literal["median", "worst"]


def rows() -> list[Row]:
    """By what is asked."""
    uses = {
        "satellite_first": (f"{SATELLITE}, 100 s", 6.0, SATELLITE, "fm.simulate(scene, 100.0)"),
        "linearize_first": ("linearize of a new scene", 4.0, BEAM, "fm.linearize(scene)"),
        "campbell_first": ("campbell of a new scene", 6.0, BEAM, "fm.campbell(scene, 'hub', [0.0, 1.0, 2.0])"),
        "advise_first": ("advise on a new scene", 20.0, BEAM, "fm.advise(scene, 1e-2, t_end=1.0)"),
    }
    found = [
        Row(name, GROUP, what, goal, partial(_in_processes, case, code, True), "at most", "s")
        for name, (what, goal, case, code) in uses.items()
    ]
    what, _, case, code = uses["satellite_first"]
    again = partial(_in_processes, case, code, False)
    found.insert(1, Row("satellite_second", GROUP, f"{what}, in a second process", 1.2, again, "at most", "s"))
    for statistic, goal in (("median", 3.0), ("worst", 8.0)):
        what = f"flexmb simulate, {statistic} of all cases"
        found.append(Row(f"cases_{statistic}", GROUP, what, goal, partial(_cases, statistic), "at most", "s"))
    return found


def _in_processes(case: str, code: str, first: bool) -> Measured:
    """A line of Python on the scene of a case; each first time with an empty folder of kernels."""
    scene = ROOT / "cases" / case / "scene.toml"
    command = [sys.executable, "-c", f"import flexmb as fm\nscene = fm.load_scene({str(scene)!r})\n{code}"]
    with tempfile.TemporaryDirectory() as folder:
        if not first:
            run(command, Path(folder) / "0")
        seconds = [run(command, Path(folder) / (f"{k}" if first else "0")).processor for k in range(ROUNDS)]
    return Measured(median(seconds), min(seconds), max(seconds), "processor time of a process")


def _cases(statistic: Statistic) -> Measured:
    every = _all_cases()
    spent = {case: seconds for case, seconds in every.items() if seconds is not None}
    worst = max(spent, key=spent.__getitem__)
    value = median(spent.values()) if statistic == "median" else spent[worst]
    detail = f"{len(spent)} of {len(every)} cases finish; worst {worst.parent.name}/{worst.name}, {spent[worst]:.3g} s"
    return Measured(value, min(spent.values()), spent[worst], detail)


@cache
def _all_cases() -> dict[Path, float | None]:
    """`flexmb simulate` of every case over its own time, charts and files too, each with an empty folder of kernels."""
    return {case: _simulated(case) for case in sorted((ROOT / "cases").glob("*/*"))}


def _simulated(case: Path) -> float | None:
    """Nothing where the run ends early: two beams turn faster than their model bears."""
    t_end = tomllib.loads((case / "run.toml").read_text(encoding="utf-8"))["duration_s"]
    main = "from flexmb.cli import main; main()"
    with tempfile.TemporaryDirectory() as folder:
        out = ["--t-end", str(t_end), "--out", str(Path(folder) / "out")]
        command = [sys.executable, "-c", main, "simulate", str(case / "scene.toml"), *out]
        try:
            return run(command, Path(folder) / "kernels").processor
        except subprocess.CalledProcessError:
            return None
