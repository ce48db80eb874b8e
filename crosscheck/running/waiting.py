"""Waiting jobs, and which of them a free worker takes."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection


class Waiting:
    """Queues of the numbers of waiting jobs, one for each kind; false if all are empty."""

    def __init__(self) -> None:
        self._jobs: dict[str, deque[int]] = {}

    def __bool__(self) -> bool:
        return any(self._jobs.values())

    def add(self, job: int, kind: str) -> None:
        self._jobs.setdefault(kind, deque()).append(job)

    def take(self, own: str, taken: Collection[str], prepared: Collection[str]) -> tuple[int, str] | None:
        """The next job for a worker, with its kind: of the worker's `own` kind, else of one that no worker runs, else
        of a `prepared` one.

        None if every waiting job is of a kind that another worker runs (`taken`) and that is not prepared: kernels that
        its first job compiles and caches are not compiled twice.
        """
        open_kinds = [kind for kind, jobs in self._jobs.items() if jobs and (kind in prepared or kind not in taken)]
        if not open_kinds:
            return None
        chosen = min(open_kinds, key=lambda kind: (kind != own, kind in taken, self._jobs[kind][0]))
        return self._jobs[chosen].popleft(), chosen
