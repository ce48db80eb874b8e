"""A scheduler by its address."""

from __future__ import annotations

from crosscheck.running.scheduler import Scheduler

LOCAL = "local"


def scheduler_at(address: str) -> Scheduler:
    """The local scheduler for "local", else the Dask cluster whose scheduler answers at `address`.

    Raises OSError where the cluster cannot be used, and ValueError where Dask is not installed; both say what to do.
    """
    if address == LOCAL:
        from crosscheck.running.pool import run_jobs  # command lines take their default from this file

        return run_jobs
    try:
        from crosscheck.running.dask_cluster import DaskCluster
    except ModuleNotFoundError as error:
        raise ValueError(f'--scheduler {address} needs Dask: pip install "flexmb[dask]" ({error})') from None
    cluster = DaskCluster(address)
    cluster.check()
    return cluster
