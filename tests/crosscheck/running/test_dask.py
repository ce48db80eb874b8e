"""The scheduler of a Dask cluster: the same events as the local pool, and dead workers cost nothing that was done."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest

pytest.importorskip("distributed")

import dask
from distributed import LocalCluster

from crosscheck.running import dask_cluster
from crosscheck.running.dask_cluster import ClusterError, DaskCluster
from crosscheck.running.scheduler import Event, Work
from crosscheck.sampling.run import run_sweep
from crosscheck.stability.run import run_map
from tests.crosscheck.running.interrupted import install_plugs, interrupt_and_go_on
from tests.crosscheck.sampling.test_sweeps import write as write_sweep
from tests.crosscheck.sessions import PROVIDER as ENGINES
from tests.crosscheck.sessions import here
from tests.crosscheck.stability.synthetic import PROVIDER as MAPS

TRIES = 2


@pytest.fixture(scope="module")
def plugs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("plugs")


@pytest.fixture(scope="module")
def gate(plugs: Path) -> Path:
    return install_plugs(plugs)


@pytest.fixture(scope="module")
def address(plugs: Path, gate: Path) -> Iterator[str]:
    with (
        pytest.MonkeyPatch.context() as patch,
        dask.config.set({"distributed.scheduler.allowed-failures": TRIES - 1}),
        _on_the_path(patch, plugs),
        LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
    ):
        yield cluster.scheduler_address


@contextmanager
def _on_the_path(patch: pytest.MonkeyPatch, plugs: Path) -> Iterator[None]:
    """Workers, which start with the path of this process, find the plug-ins."""
    patch.syspath_prepend(plugs)
    yield


def work(job: tuple[str, str], emit: Callable[[object], None]) -> None:
    what, folder = job
    with (Path(folder) / what).open("a") as diary:
        diary.write(f"{os.getpid()}\n")
    emit(f"{what} begun")
    match what:
        case "die":
            os._exit(7)
        case "hang":
            time.sleep(3600.0)
        case "eat":
            kept = []
            while True:
                kept.append(bytearray(2**25))
                time.sleep(0.002)
        case "kill the worker once" if len((Path(folder) / what).read_text().splitlines()) == 1:
            os.kill(os.getppid(), signal.SIGKILL)
            time.sleep(60.0)
        case "kill the worker":
            os.kill(os.getppid(), signal.SIGKILL)
            time.sleep(60.0)
    emit(os.getpid())


def run(address: str, folder: Path, whats: list[str], **options: object) -> dict[str, list[Event]]:
    jobs = [(what, str(folder)) for what in whats]
    found: dict[str, list[Event]] = {what: [] for what in whats}
    for event in DaskCluster(address)(Work(work, jobs, "", **options)):
        found[whats[event.job]].append(event)
    return found


@pytest.mark.parametrize(
    "whats",
    [
        ["good", "die", "kill the worker once"],
        pytest.param(["hang", "good", "eat", "better", "die", "best"], marks=pytest.mark.slow),
    ],
)
def test_every_job_is_answered_once_and_a_crash_costs_only_its_own(
    address: str, tmp_path: Path, whats: list[str]
) -> None:
    """Also what hangs or eats memory, and a job that takes its Dask worker with it: that is tried again."""
    found = run(
        address, tmp_path, whats, memory_limit_bytes=0.4e9,
        time_limit_s=lambda job: 2.0 if job[0] == "hang" else 60.0,
    )  # fmt: skip
    ends = {
        "die": ("crashed", "the worker process died (exit code 7)"),
        "hang": ("stopped", "at its limit of 2 s"),
        "eat": ("stopped", "GB of memory where 0.4 GB are its part"),
    }
    for what, events in found.items():
        kind, words = ends.get(what, ("ended", ""))
        assert [events[0].kind, events[-1].kind] == ["started", kind], (what, events)
        assert words in str(events[-1].content)
        contents = [event.content for event in events if event.kind == "emitted"]
        assert contents[0] == f"{what} begun" and len(contents) == 1 + (kind == "ended"), (what, contents)
    if "kill the worker once" in whats:
        assert len((tmp_path / "kill the worker once").read_text().splitlines()) == TRIES


@pytest.mark.slow
def test_a_job_that_kills_every_worker_crashes_and_no_process_is_left(address: str, tmp_path: Path) -> None:
    found = run(address, tmp_path, ["kill the worker", "good"])
    last = found["kill the worker"][-1]
    assert last.kind == "crashed" and f"{TRIES} times" in last.content
    assert found["good"][-1].kind == "ended"
    pids = [int(line) for file in tmp_path.iterdir() for line in file.read_text().split()]
    deadline = time.monotonic() + 10.0
    while any(psutil.pid_exists(pid) for pid in pids) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not any(psutil.pid_exists(pid) for pid in pids)


def test_workers_with_other_sources_are_refused(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_cluster, "code_here", os.getpid)
    with pytest.raises(ClusterError, match="other sources than this process: tcp://"):
        DaskCluster(address).check()


def test_nobody_at_the_address_is_said_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_cluster, "ANSWER_S", 0.5)
    with pytest.raises(ClusterError, match=r"no Dask scheduler answers at tcp://127.0.0.1:1 .*--scheduler local"):
        DaskCluster("tcp://127.0.0.1:1").check()


@pytest.mark.slow
def test_an_interrupted_session_leaves_whole_records_and_goes_on(
    address: str, plugs: Path, gate: Path, tmp_path: Path
) -> None:
    interrupt_and_go_on(plugs, gate, tmp_path, "--scheduler", address)


@pytest.mark.slow
def test_sweeps_and_maps_on_a_cluster_give_what_they_give_here(address: str, tmp_path: Path) -> None:
    cluster = DaskCluster(address)
    file = write_sweep(tmp_path, "fine")
    for name, scheduler in (("here", here), ("there", cluster)):
        (tmp_path / name).mkdir()
        run_sweep(file, tmp_path / name, provider=ENGINES, scheduler=scheduler)
    assert (tmp_path / "here" / "samples.csv").read_bytes() == (tmp_path / "there" / "samples.csv").read_bytes()
    near, far = (
        run_map("circle", tmp_path / f"{name}.jsonl", provider=MAPS, scheduler=scheduler, depth=2)
        for name, scheduler in (("circle_here", here), ("circle_there", cluster))
    )
    assert near.verdict.cells == far.verdict.cells and near.mesh.labels == far.mesh.labels
