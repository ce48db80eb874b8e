"""The request on pytest's command line, checked before anything runs."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path

import pytest

from crosscheck.engines.registry import engines
from crosscheck.library.case import CaseError
from crosscheck.library.find import Case, resolve
from crosscheck.library.with_claims import expect_file, with_claims
from crosscheck.pytest_plugin.runs import SessionRuns
from flexmb.scene.problems import closest

# Marks with a meaning in pytest, which tags must not have.
PYTESTS_OWN = {"skip", "skipif", "xfail", "parametrize", "usefixtures", "filterwarnings", "tryfirst", "trylast"}


@dataclass(frozen=True)
class Request:
    """Cases and engines, the runs that they share, strictness, and the file of the user's expectations."""

    cases: tuple[Case, ...]
    engines: tuple[str, ...]
    contract: bool
    strict: bool
    allow_missing: bool
    runs: SessionRuns
    expectations: Path | None = None

    @property
    def tags(self) -> tuple[str, ...]:
        """Tags of the cases, which become marks."""
        tags = dict.fromkeys(tag for case in self.cases for tag in marks_of(case))
        return tuple(tags)

    @property
    def headline(self) -> str:
        count = f"{len(self.cases)} case{'' if len(self.cases) == 1 else 's'}"
        parts = [*([count] if self.cases else []), *(["the contract"] if self.contract else [])]
        own = "" if self.expectations is None else f", expectations of {self.expectations}"
        return f"crosscheck: {' and '.join(parts)} on {', '.join(self.engines)}{own}, records in {self.runs.folder}"


def read_request(options: Namespace, folder: Path, session: str) -> Request:
    """The request of a command line; pytest.UsageError names the error and the choices."""
    names = tuple(dict.fromkeys(options.crosscheck_engine))
    if not names:
        raise pytest.UsageError("--crosscheck needs --crosscheck-engine NAME: `crosscheck engines` shows them")
    if not (options.crosscheck or options.crosscheck_contract):
        raise pytest.UsageError("--crosscheck-engine needs --crosscheck CASES, or --crosscheck-contract, or both")
    known = engines()
    for name in names:
        if name not in known and not options.crosscheck_allow_missing:
            raise pytest.UsageError(f'--crosscheck-engine: no engine "{name}": {closest(name, known)}')
    try:
        expected = None if options.crosscheck_expect is None else Path(options.crosscheck_expect)
        file = expect_file(expected)
        cases = with_claims(resolve(tuple(options.crosscheck)), file, asked=names)
    except CaseError as error:
        raise pytest.UsageError(f"--crosscheck: {error}") from None
    return Request(
        cases=cases,
        engines=names,
        contract=options.crosscheck_contract,
        strict=options.crosscheck_strict,
        allow_missing=options.crosscheck_allow_missing,
        runs=SessionRuns(folder, session),
        expectations=file,
    )


def marks_of(case: Case) -> tuple[str, ...]:
    """The tags of a case that can be marks."""
    return tuple(tag for tag in case.run.tags if tag.isidentifier() and tag not in PYTESTS_OWN)
