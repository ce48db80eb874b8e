"""A column of a progress bar with the approximate time left."""

from __future__ import annotations

import time

from rich.progress import ProgressColumn, Task
from rich.text import Text

NONE = "no estimate yet"


class TimeLeft(ProgressColumn):
    """The time until a task's field `ends_at` (s, of `time.monotonic`), as far as it can be estimated."""

    max_refresh = 0.5

    def render(self, task: Task) -> Text:
        ends_at: float | None = task.fields.get("ends_at")
        return Text(NONE if ends_at is None else f"about {in_words(ends_at - time.monotonic())} left", "cyan")


def in_words(seconds: float) -> str:
    """A duration, rounded as an estimate; at least one second."""
    seconds = max(seconds, 1.0)
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 1.5 * size:
            return f"{seconds / size:.1f} {unit}" if seconds < 9.5 * size else f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"
