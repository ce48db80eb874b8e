"""A scheduler by its address."""

from __future__ import annotations

from crosscheck.running.scheduler import Scheduler

LOCAL = "local"


def scheduler_at(address: str) -> Scheduler:
    """The local scheduler for "local", else the Dask cluster whose scheduler has this `address`.

    Raises OSError if the cluster cannot be used, ValueError if Dask is not installed; both name the remedy.
    """
    if address == LOCAL:
        from crosscheck.running.pool import run_jobs  # imported here, since command lines import this file

        return run_jobs
    try:
        from crosscheck.running.dask_cluster import DaskCluster
    except ModuleNotFoundError as error:
        raise ValueError(f'--scheduler {address} needs Dask: pip install "dask[distributed]" ({error})') from None
    cluster = DaskCluster(address)
    cluster.check()
    return cluster
