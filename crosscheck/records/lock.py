"""A lock on a folder: a second process that wants to write there is refused and told which process holds the lock."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from filelock import FileLock, Timeout

from flexmb.output.files import folder as made
from flexmb.output.files import writing

LOCK, HOLDER = ".crosscheck.lock", ".crosscheck.holder"


class FolderInUseError(RuntimeError):
    """Another process writes into the folder; the message says which and since when."""


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a folder, which is made if needed; raises FolderInUseError if another process holds the lock.

    The operating system releases the lock when the process ends in any way.
    """
    made(folder)
    lock, holder = FileLock(folder / LOCK), folder / HOLDER
    try:
        lock.acquire(blocking=False)
    except Timeout:
        raise FolderInUseError(
            f"{folder} is in use by {_who(holder)}. Wait for its end, or give another folder with --out."
        ) from None
    try:
        now = f"{datetime.now(UTC):%Y-%m-%d %H:%M:%S}"
        with writing(holder):
            holder.write_text(f"process {os.getpid()} since {now} UTC", encoding="utf-8")
        yield
    finally:
        holder.unlink(missing_ok=True)
        lock.release()


def _who(holder: Path) -> str:
    try:
        return holder.read_text(encoding="utf-8") or "another process"
    except OSError:
        return "another process"
