"""The pytest plug-in: `pytest --crosscheck CASES --crosscheck-engine NAME` tests an engine on stored references.

Every channel of a case for which there is a goal is a test item, `crosscheck::family/case[engine-channel]`, with the
mark `crosscheck` and the tags of the case as marks. E, U, goal, status and the digest of the reference are properties
of the item, in junit.xml too. An engine runs a case once in a session, in a process of its own, also under xdist.

An outcome that the case expects, other than agreement, is an expected failure with its reason. What an engine refuses
is skipped with the engine's reason (with `--crosscheck-strict` it fails), and a session in which an engine was not
compared at all fails. A missing engine is an error. Nothing is left out silently.

This module is imported by every pytest where crosscheck is installed: it imports other modules of crosscheck only when
they are needed.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import uuid
from collections.abc import Generator, Sequence
from contextlib import suppress
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from crosscheck.pytest_plugin.request import Request

REQUEST: pytest.StashKey[Request] = pytest.StashKey()
TEMPORARY = pytest.StashKey[Path]()
SHARED = "crosscheck_shared"  # key of the folder and session that xdist's controller sends to its workers


class AsInstalled:
    """Finds the modules of flexmb and crosscheck as without pytest; other modules are left to other finders.

    pytest rewrites the assertions of every package in a distribution that has a plug-in. Here that is a library, whose
    code, tracebacks and start should be the same under pytest. The first finder in `sys.meta_path` decides.
    """

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None = None, target: Any = None) -> ModuleSpec | None:
        """The specification that Python itself finds, or None for a module that is not ours."""
        return PathFinder.find_spec(name, path, target) if name.partition(".")[0] in ("flexmb", "crosscheck") else None


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options in a group of their own. pytest calls this before any conftest.py is imported."""
    sys.meta_path.insert(0, AsInstalled)
    group = parser.getgroup("crosscheck", "hold a multibody engine against the reference cases")
    group.addoption(
        "--crosscheck", action="append", default=[], metavar="CASES",
        help="a case, a shell pattern of case names, a family, a tag, `all`, or a folder with a run.toml; behind a `!` "
        "what is left out; may be repeated",
    )  # fmt: skip
    group.addoption(
        "--crosscheck-engine", action="append", default=[], metavar="NAME",
        help="an engine of the entry-point group crosscheck.engines; may be repeated",
    )  # fmt: skip
    group.addoption(
        "--crosscheck-contract", action="store_true", help="try the clauses of the contract on each engine as well"
    )
    group.addoption(
        "--crosscheck-expect", metavar="FILE",
        help="goals and failures of your engine; by default crosscheck-expect.toml in the working folder, if there",
    )  # fmt: skip
    group.addoption("--crosscheck-out", metavar="DIR", help="keep the records of all runs in this folder")
    group.addoption(
        "--crosscheck-strict", action="store_true",
        help="what an engine refuses, and figures worse than accepted ones, are failures",
    )  # fmt: skip
    group.addoption(
        "--crosscheck-allow-missing", action="store_true", help="skip engines that are not installed: no error"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Read the request; pytest.UsageError if it is invalid."""
    config.addinivalue_line("markers", "crosscheck: a case of the crosscheck library on an engine")
    options = config.option
    if not (options.crosscheck or options.crosscheck_engine or options.crosscheck_contract):
        return
    from crosscheck.pytest_plugin.compared import NothingCompared
    from crosscheck.pytest_plugin.request import read_request

    folder, session = _shared(config)
    request = read_request(options, folder, session)
    config.stash[REQUEST] = request
    for tag in request.tags:
        config.addinivalue_line("markers", f"{tag}: crosscheck cases with this tag")
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(NothingCompared(), "crosscheck-compared")


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove the records, unless they are to be kept, and the finder of our modules."""
    with suppress(ValueError):  # a nested session may have restored the path already
        sys.meta_path.remove(AsInstalled)
    temporary = config.stash.get(TEMPORARY, None)
    if temporary is not None:
        shutil.rmtree(temporary, ignore_errors=True)


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Send the shared folder and session to a worker of xdist."""
    if REQUEST in node.config.stash:
        runs = node.config.stash[REQUEST].runs
        node.workerinput[SHARED] = [str(runs.folder), runs.session]


def pytest_report_header(config: pytest.Config) -> str | None:
    """The request in one line."""
    return config.stash[REQUEST].headline if REQUEST in config.stash else None


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Add the requested items to those that the session has collected."""
    report = yield
    request = collector.config.stash.get(REQUEST, None)
    if request is not None and isinstance(collector, pytest.Session) and report.passed:
        from crosscheck.pytest_plugin.items import PREFIX, CrosscheckItems

        everything = CrosscheckItems.from_parent(collector, name=PREFIX, nodeid=PREFIX, request=request)
        report.result.append(everything)
    return report


def _shared(config: pytest.Config) -> tuple[Path, str]:
    """Folder of the records and name of the session: in a worker of xdist those of its controller."""
    if hasattr(config, "workerinput"):
        folder, session = config.workerinput[SHARED]
        return Path(folder), session
    if config.option.crosscheck_out:
        return Path(config.option.crosscheck_out), uuid.uuid4().hex
    config.stash[TEMPORARY] = Path(tempfile.mkdtemp(prefix="crosscheck-"))
    return config.stash[TEMPORARY], uuid.uuid4().hex
