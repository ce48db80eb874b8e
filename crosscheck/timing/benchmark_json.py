"""Benchmarks with the statistics and in the JSON of pytest-benchmark, for `pytest-benchmark compare`."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from crosscheck.records.machine import environment
from crosscheck.timing.bench import CaseBench, Contest

if TYPE_CHECKING:
    from pytest_benchmark.stats import Stats

PACKAGE = "pytest_benchmark"
MISSING = "pytest-benchmark is not installed, whose statistics and files these are: pip install pytest-benchmark"


def available() -> bool:
    """Whether the package is installed."""
    return find_spec(PACKAGE) is not None


def statistics(contest: Contest) -> Stats:
    """Minimum, quartiles and other statistics of the solves' seconds in a timed contest."""
    from pytest_benchmark.stats import Stats

    assert contest.timed is not None
    stats = Stats()
    for sample in contest.timed.samples:
        stats.update(sample.solve_s)
    return stats


def benchmark_document(benches: Sequence[CaseBench]) -> dict[str, Any]:
    """The document: a benchmark for each timed rival; the others, with the reason, under "not_timed"."""
    from pytest_benchmark import __version__
    from pytest_benchmark.plugin import pytest_benchmark_generate_machine_info
    from pytest_benchmark.utils import get_commit_info

    here = environment()
    return {
        "machine_info": pytest_benchmark_generate_machine_info() | {"packages": here.packages, "cores": here.cores},
        "commit_info": get_commit_info(),
        "benchmarks": [
            _benchmark(bench, contest) for bench in benches for contest in bench.contests if contest.timed is not None
        ],
        "datetime": datetime.now(UTC).isoformat(),
        "version": __version__,
        "not_timed": [
            *({"case": bench.case, "name": "", "why": bench.problem} for bench in benches if bench.problem),
            *(
                {"case": bench.case, "name": contest.rival.name, "why": contest.why}
                for bench in benches
                for contest in bench.contests
                if contest.timed is None
            ),
        ],
    }


def _benchmark(bench: CaseBench, contest: Contest) -> dict[str, Any]:
    rival, rung, timed = contest.rival, contest.rung, contest.timed
    assert rung is not None and timed is not None and timed.prepared is not None and timed.first is not None
    label = rung.effort.label
    stats = statistics(contest)
    return {
        "group": bench.case,
        "name": f"{rival.name} · {label}",
        "fullname": f"{bench.case}::{rival.name} · {label}",
        "params": {
            "variant": rival.job.variant,
            "engine": rival.job.engine,
            "level": rival.level,
            "algorithm": contest.facts.algorithm,
            "integrator": rung.effort.method,
        },
        "param": f"{rival.name} · {label}",
        "extra_info": {
            "standing": contest.standing,
            "why": contest.why,
            "error": rung.error,
            "accuracy": bench.accuracy,
            "engine_version": rival.version,
            "settings": contest.facts.settings,
            "effort": label,
            "evaluations": rung.evaluations,
            "first_compile_s": rival.compile_s,
            "compile_in_a_new_process_s": timed.prepared.first_s,
            "compile_again_s": timed.prepared.again_s,
            "call_min_s": min(sample.call_s for sample in timed.samples),
            "cpu_min_s": min(sample.cpu_s for sample in timed.samples),
        },
        "options": {"disable_gc": True, "timer": "wall_s of the engine", "warmup": True, "min_rounds": bench.rounds},
        "stats": stats.as_dict() | {"data": stats.data, "iterations": 1},
    }
