"""A session fails if an engine was not compared at all, even if each of its items was skipped with a reason."""

from __future__ import annotations

from math import inf
from typing import Any

import pytest

from crosscheck.pytest_plugin.items import PREFIX


class NothingCompared:
    """Counts, in the process that sees all reports, the items in which each engine was really compared."""

    def __init__(self) -> None:
        self._compared: dict[str, int] = {}
        self._loosened: dict[str, int] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count an item: a skip is no comparison, an expected failure is one."""
        if not report.nodeid.startswith(f"{PREFIX}::"):
            return
        told: dict[str, Any] = dict(report.user_properties)
        engine = str(told.get("engine"))
        looser = float(told.get("goal") or 0.0) > float(told.get("case_goal", inf))
        if report.when == "call" and report.passed and looser:
            reason = str(told["goal_reason"])
            self._loosened[reason] = self._loosened.get(reason, 0) + 1
        compared = report.when == "call" and (not report.skipped or hasattr(report, "wasxfail"))
        self._compared[engine] = self._compared.get(engine, 0) + (compared or report.failed)

    @property
    def idle(self) -> list[str]:
        """Engines that were asked for and not compared at all."""
        return [engine for engine, count in self._compared.items() if not count]

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        """Let the session fail if an engine was not compared at all."""
        allowed = session.config.option.crosscheck_allow_missing
        if self.idle and not allowed and exitstatus in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Name the engines that were not compared, and count what passed by a goal looser than the case's."""
        for reason, count in self._loosened.items():
            terminalreporter.write_line(f"crosscheck: {count} passed by goals looser than the case's: {reason}")
        for engine in self.idle:
            terminalreporter.write_line(f"crosscheck: {engine} was compared in nothing: all its items were skipped")
