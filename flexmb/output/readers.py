"""Readers of what a command prints that go away early, as `head -1` does.

A command goes on to its end then, and its exit code is the one that it would have with all of its output read: it
computes, judges and writes files, and stopping in the midst of that because of a closed pipe would lose them. Python
raises an error instead, at the first write that nobody reads or when it flushes at exit.
"""

from __future__ import annotations

import io
import os
import stat
import sys
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from typing_extensions import Buffer


class _Pipe(io.FileIO):
    """A pipe of which the other end may be closed: from then on it takes everything and passes nothing on."""

    def write(self, content: Buffer, /) -> int:
        try:
            return super().write(content)
        except BrokenPipeError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            return memoryview(content).nbytes


def outlive_readers() -> None:
    """Let this process go on where the reader of its stdout or its stderr has closed the pipe."""
    sys.stdout, sys.stderr = _outliving(sys.stdout), _outliving(sys.stderr)


def _outliving(stream: TextIO) -> TextIO:
    """The stream, or where it is a pipe or a socket one in its place that outlives its reader."""
    try:
        number = stream.fileno()
        mode = os.fstat(number).st_mode
    except (AttributeError, OSError, ValueError):  # there is none, it is closed, or it is no file
        return stream
    if not (stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode)):
        return stream
    stream.flush()
    buffer = io.BufferedWriter(_Pipe(number, "w", closefd=False))
    return io.TextIOWrapper(
        buffer, encoding=stream.encoding, errors=stream.errors, line_buffering=stream is sys.__stderr__
    )
