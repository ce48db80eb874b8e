"""Common parts of all commands: consoles, exit codes, parsing of options, and errors as messages."""

from __future__ import annotations

import platform
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from flexmb.output.files import in_words
from flexmb.output.printable import printable
from flexmb.output.terminal import Terminal
from flexmb.output.versions import version_of
from flexmb.scene.problems import SceneError, SceneWarning
from flexmb.scene.user_code import forbid_user_code


def versions_text() -> str:
    """Versions of this package, Python, and the libraries on which results and speed depend."""
    lines = [f"flexmb {version_of('flexmb')}", f"Python {platform.python_version()}"]
    return "\n".join([*lines, *(f"{name} {version_of(name)}" for name in ("numba", "numpy", "scipy"))])


MOST_STEPS = 10_000  # of a range; each step computes a steady state
EXIT_STOPPED = 1
EXIT_USAGE = 2
EXIT_INTERRUPTED = 130  # the convention of shells: 128 plus the number of the signal

console = Terminal()
errors = Terminal(stderr=True)

SceneFile = Annotated[Path, typer.Argument(help="Scene file (TOML).", metavar="SCENE", show_default=False)]
Strict = Annotated[bool, typer.Option("--strict", help="Warnings about the scene are errors.")]


def _forbid(asked: bool) -> bool:
    if asked:
        forbid_user_code()
    return asked


NoUserCode = Annotated[
    bool,
    typer.Option("--no-user-code", callback=_forbid, help="Import no function that a scene names: refuse such scenes."),
]


def vector(option: str, text: str) -> tuple[float, ...]:
    """Three numbers, or the unit vector along x, y or z."""
    if text in ("x", "y", "z"):
        return tuple(float(text == name) for name in "xyz")
    try:
        numbers = tuple(float(word) for word in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != 3:
        raise ValueError(f"--{option} is x, y, z or three numbers such as 0,0.6,0.8; got {text!r}")
    return numbers


def range_of(option: str, text: str) -> list[float]:
    """Equally spaced numbers from `from:to:count`, both ends included."""
    try:
        first, last, count = text.split(":")
        start, stop, steps = float(first), float(last), int(count)
    except ValueError:
        raise ValueError(f"--{option} is from:to:count, such as 0:40:41; got {text!r:.60}") from None
    if not 2 <= steps <= MOST_STEPS or not isfinite(stop - start):
        raise ValueError(f"--{option}: give 2 to {MOST_STEPS} values between finite ends, not {text:.60}")
    return [start + (stop - start) * i / (steps - 1) for i in range(steps)]


@contextmanager
def no_traceback(strict: bool = False) -> Iterator[None]:
    """Print warnings, and errors that the user can correct, as messages on stderr, without tracebacks.

    `strict`: warnings about the scene are errors.
    """
    with warnings.catch_warnings():
        warnings.showwarning = _show
        if strict:
            warnings.simplefilter("error", SceneWarning)
        with _messages():
            yield


def _show(message: Warning | str, *_: object) -> None:
    errors.print(Text("warning: ", style="bold yellow") + Text(printable(str(message))), soft_wrap=True)


@contextmanager
def _messages() -> Iterator[None]:
    try:
        yield
    except (SceneError, SceneWarning, NotImplementedError, ValueError, ImportError, OSError) as error:
        raise _ended(in_words(error) if isinstance(error, OSError) else str(error), EXIT_USAGE) from None
    except ArithmeticError as error:  # there is no equilibrium, or the accelerations do not exist or overflow
        raise _ended(str(error), EXIT_STOPPED) from None


def _ended(message: str, code: int) -> typer.Exit:
    errors.print(Text("error: ", style="bold red") + Text(printable(message)), soft_wrap=True)
    return typer.Exit(code)
