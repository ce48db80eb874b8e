"""Draws are pinned in the suite that newcomers and CI run, and searched where slow tests are asked for."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest
from hypothesis import settings

from tests.repo.project import ROOT

UNSEEDED = re.compile(
    r"default_rng\((None)?\)|np\.random\.(seed|rand|randn|randint|normal|uniform|random|choice)\b|\bRandom\(\)"
    r"|^import random$(?s:.*)^\s*.*\brandom\.(random|choice|randint|uniform|shuffle|sample)\(",
    re.MULTILINE,
)
"""Generators that begin elsewhere in every process."""


def test_draws_are_pinned(pytestconfig: pytest.Config) -> None:
    searched = pytestconfig.option.markexpr == "slow"
    assert settings.default.derandomize is not searched
    assert settings.default.database is None  # what failed yesterday on this machine is no part of the suite


@pytest.mark.parametrize("text", ["default_rng()", "np.random.normal(3)", "Random()", "import random\nrandom.random()"])
def test_generators_without_a_seed_are_seen(text: str) -> None:
    assert UNSEEDED.search(text)


def test_no_test_draws_without_a_seed() -> None:
    found = [
        str(path.relative_to(ROOT))
        for path in sorted((ROOT / "tests").rglob("test_*.py"))
        if path.name != "test_draws.py" and UNSEEDED.search(path.read_text(encoding="utf-8"))
    ]
    assert not found, f"give their generators a seed: {found}"


def test_slow_tests_are_also_those_that_draw() -> None:
    """Nowhere else would they be searched on."""
    drawn = "tests/crosscheck/report/test_workprecision.py"
    session = subprocess.run(
        [sys.executable, "-m", "pytest", "-m", "slow", "--collect-only", "-q", drawn],
        capture_output=True, text=True, cwd=ROOT,
    )  # fmt: skip
    assert "test_every_series_comes_back" in session.stdout, session.stdout + session.stderr
