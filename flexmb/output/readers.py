"""Commands whose output is a pipe that its reader closes early, such as `head -1`.

The command runs to its end and has the same exit code as if all of its output were read: it computes, judges and
writes files, which a closed pipe must not interrupt. Python's default is an error at the next write, or when it
flushes at exit.
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
    """A pipe whose other end may be closed: from then on everything written is discarded."""

    def write(self, content: Buffer, /) -> int:
        try:
            return super().write(content)
        except BrokenPipeError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            return memoryview(content).nbytes


def outlive_readers() -> None:
    """Let this process continue when the reader of its stdout or stderr closes the pipe."""
    sys.stdout, sys.stderr = _outliving(sys.stdout), _outliving(sys.stderr)


def _outliving(stream: TextIO) -> TextIO:
    """The stream itself, or a stream that survives its reader if it is a pipe or a socket."""
    try:
        number = stream.fileno()
        mode = os.fstat(number).st_mode
    except (AttributeError, OSError, ValueError):  # there is no stream, it is closed, or it is not a file
        return stream
    if not (stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode)):
        return stream
    stream.flush()
    buffer = io.BufferedWriter(_Pipe(number, "w", closefd=False))
    return io.TextIOWrapper(
        buffer, encoding=stream.encoding, errors=stream.errors, line_buffering=stream is sys.__stderr__
    )
