"""What holds for every test: general kernels, draws that are pinned, and skips that are told by reason.

Kernels of the suite are general ones: a thousand scenes, each for a moment, would each ask for kernels of its own. That
kernels of a scene's own features compute the same is for tests/flexmb/tables/test_features.py to show.

Whoever runs the suite gets the same draws; `-m slow` searches on: there tests by hypothesis count as slow, and draw
ten times as many examples at random.
"""

import gc
import os
from collections import Counter
from fnmatch import fnmatchcase
from pathlib import Path

import pytest
from hypothesis import settings

os.environ.setdefault("FLEXMB_KERNELS", "general")

settings.register_profile("pinned", derandomize=True, database=None, deadline=None)
settings.register_profile("search", parent=settings.get_profile("pinned"), derandomize=False, max_examples=1000)


def _searches(config: pytest.Config) -> bool:
    """Whether the session was asked for slow tests."""
    return config.option.markexpr == "slow"


def pytest_configure(config: pytest.Config) -> None:
    """The profile of the draws, before any module of tests takes its settings from it."""
    settings.load_profile("search" if _searches(config) else "pinned")
    config.addinivalue_line("filterwarnings", "error:.* holds addresses of this process:RuntimeWarning")


TESTS = Path(__file__).parent
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


def pytest_collection_finish() -> None:
    """The collector passes over what is there from now on: a million objects of numba's, and thousands of tests."""
    gc.collect()
    gc.freeze()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Skips by reason, the most frequent first."""
    skips = terminalreporter.stats.get("skipped", [])
    reasons = Counter(skip.longrepr[2].removeprefix("Skipped: ") for skip in skips)
    if reasons:
        terminalreporter.section(f"{len(skips)} skipped, by reason")
    for reason, count in reasons.most_common():
        terminalreporter.write_line(f"{count:5d}  {reason}")
