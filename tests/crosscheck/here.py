"""A scheduler of the tests without processes and limits: one job after the other, in this process."""

from __future__ import annotations

from typing import Any

from crosscheck.running.scheduler import Event, Events, Work


def run_here(work: Work) -> Events:
    number = 0
    while number < len(work.jobs):
        found: list[Any] = []
        yield Event(number, "started")
        work.function(work.jobs[number], found.append)
        yield from (Event(number, "emitted", content) for content in found)
        yield Event(number, "ended")
        number += 1
