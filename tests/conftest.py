"""What holds for every test: general kernels, draws that are pinned, and skips that are told by reason.

Kernels of the suite are general ones: a thousand scenes, each for a moment, would each ask for kernels of its own. That
kernels of a scene's own features compute the same is for tests/flexmb/tables/test_features.py to show.

Whoever runs the suite gets the same draws; `-m slow` searches on: there tests by hypothesis count as slow, and draw
ten times as many examples at random.

The default suite is short: it names files that take much of its processor time, and fails (`tests/times.py`).
"""

import gc
import os
from collections import Counter
from collections.abc import Generator
from fnmatch import fnmatchcase
from pathlib import Path

import pytest
from hypothesis import settings

from tests.times import WHOLE, excesses, is_shared, processor_s

os.environ.setdefault("FLEXMB_KERNELS", "general")

settings.register_profile("pinned", derandomize=True, database=None, deadline=None)
settings.register_profile("search", parent=settings.get_profile("pinned"), derandomize=False, max_examples=1000)


def _searches(config: pytest.Config) -> bool:
    """Whether the session was asked for slow tests."""
    return config.option.markexpr == "slow"


def pytest_configure(config: pytest.Config) -> None:
    """The profile of the draws, before any module of tests takes its settings from it."""
    settings.load_profile("search" if _searches(config) else "pinned")
    if hasattr(config.option, "loadscopereorder"):
        config.option.loadscopereorder = False  # pytest-xdist would begin files of few, long tests last
    config.addinivalue_line("filterwarnings", "error:.* holds addresses of this process:RuntimeWarning")


TESTS = Path(__file__).parent
BEGIN = (
    "repo/test_code.py", "flexmb/system/test_public_calls.py", "fuzz/test_fuzz.py", "test_bounded_work.py",
    "flexmb/system/test_threads.py", "crosscheck/engines/test_bad_engines.py",
)  # fmt: skip
"""Files with tests that take long, which one process would end alone if it began them late."""
LONG = [line for line in (TESTS / "slow.txt").read_text(encoding="utf-8").splitlines() if line and line[0] != "#"]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """What counts as slow, before pytest itself selects by marks: the tests of slow.txt and, where draws are searched,
    all that draw."""
    by_file = dict[Path, list[pytest.Item]]()
    for item in items:
        by_file.setdefault(item.path, []).append(item)
        if _searches(config) and getattr(getattr(item, "obj", None), "is_hypothesis_test", False):
            item.add_marker(pytest.mark.slow)
    for line in LONG:
        file, _, names = line.partition("::")
        name, *kept = names.split(" but ")
        of_file = by_file.get(TESTS / file, ())
        whole = TESTS / file in by_file and not any("::" in arg for arg in config.args)
        for pattern in (name, *kept):
            if not any(fnmatchcase(item.name, pattern) for item in of_file) and (
                whole or not (TESTS / file).exists()
            ):
                raise pytest.UsageError(f"tests/slow.txt: no test is {file}::{pattern}: correct or remove the line")
        for item in of_file:
            if fnmatchcase(item.name, name) and not any(fnmatchcase(item.name, pattern) for pattern in kept):
                item.add_marker(pytest.mark.slow)
    early = {TESTS / file: i for i, file in enumerate(BEGIN)}
    items.sort(key=lambda item: early.get(item.path, len(early)))


def pytest_collection_finish() -> None:
    """The collector passes over what is there from now on: a million objects of numba's, and thousands of tests.

    What it took to find the tests is none of the first one's time.
    """
    global _before
    gc.collect()
    gc.freeze()
    _before = processor_s()


_spent, _tests = Counter[str](), set[str]()
_before = processor_s()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Reports have the processor time since the one before, in whatever process the tests run."""
    global _before
    report = yield
    now = processor_s()
    report.processor_s, _before = now - _before, now  # type: ignore[attr-defined]
    return report


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Processor time by file; under pytest-xdist, reports of all processes come here."""
    _spent[report.nodeid.partition("::")[0]] += getattr(report, "processor_s", 0.0)
    _tests.add(report.nodeid)


def _too_long(config: pytest.Config) -> list[str]:
    """What is said at the end of the default suite."""
    if hasattr(config, "workerinput") or config.option.markexpr != "not slow":
        return []
    return excesses(_spent, len(_tests), is_shared())


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """A suite that has become long fails, although all tests have passed."""
    if session.exitstatus == pytest.ExitCode.OK and _too_long(session.config):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Files by processor time, and what is too long; skips by reason, the most frequent first."""
    if len(_tests) >= WHOLE:
        terminalreporter.section(f"{sum(_spent.values()):.0f} s of processor time, by file")
        for file, seconds in _spent.most_common(10):
            terminalreporter.write_line(f"{seconds:5.0f}  {file}")
    for words in _too_long(config):
        terminalreporter.write_line(f"FAILED: {words}: make tests cheaper, or list them in tests/slow.txt", red=True)
    skips = terminalreporter.stats.get("skipped", [])
    reasons = Counter(skip.longrepr[2].removeprefix("Skipped: ") for skip in skips)
    if reasons:
        terminalreporter.section(f"{len(skips)} skipped, by reason")
    for reason, count in reasons.most_common():
        terminalreporter.write_line(f"{count:5d}  {reason}")
