"""Jobs that wait, and which of them a free worker takes."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection


class Waiting:
    """Numbers of waiting jobs by kind, first come first; false when none waits."""

    def __init__(self) -> None:
        self._jobs: dict[str, deque[int]] = {}

    def __bool__(self) -> bool:
        return any(self._jobs.values())

    def add(self, job: int, kind: str) -> None:
        self._jobs.setdefault(kind, deque()).append(job)

    def take(self, own: str, taken: Collection[str], prepared: Collection[str]) -> tuple[int, str] | None:
        """The first job of the worker's `own` kind, else of a kind nobody is at, else of a `prepared` kind; its kind.

        None where all that waits is of a kind that another worker has `taken` and that is not prepared: what its first
        job compiles and leaves on disk is not compiled twice.
        """
        open_kinds = [kind for kind, jobs in self._jobs.items() if jobs and (kind in prepared or kind not in taken)]
        if not open_kinds:
            return None
        chosen = min(open_kinds, key=lambda kind: (kind != own, kind in taken, self._jobs[kind][0]))
        return self._jobs[chosen].popleft(), chosen
