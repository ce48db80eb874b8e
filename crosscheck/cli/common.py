"""What all commands share: the application, the console, options that several have, and how errors are shown."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from math import inf
from pathlib import Path
from typing import Annotated, NoReturn

import typer
from rich.console import Console

from crosscheck.library import find
from crosscheck.library.case import CaseError
from crosscheck.records.lock import FolderInUseError, locked
from crosscheck.running.pool import TIME_LIMIT_S
from crosscheck.terminal.text import words
from flexmb.output.writing import in_words

EXIT_USAGE = 2

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    help="""
Run the same multibody scene in independent codes and say who **agrees** with whom, on what, by how much, how fast.

Start with `crosscheck run canonical`, then open the report whose path it prints.
`crosscheck list` shows the cases, `crosscheck engines` the codes that are installed here.
""",
)
console = Console(markup=False, emoji=False)  # names and paths stand in what it prints

Out = Annotated[Path, typer.Option("--out", "-o", help="Folder for records, verdicts and report.")]
TimeLimit = Annotated[
    float | None,
    typer.Option(
        "--time-limit", metavar="SECONDS", help=f"Stop what takes longer; default the case's limit or {TIME_LIMIT_S:g}."
    ),
]
Jobs = Annotated[int | None, typer.Option("--jobs", "-j", min=1, help="Worker processes; by default one per core.")]
Strict = Annotated[bool, typer.Option("--strict", help="Figures worse than recorded, or not recorded, are errors.")]
SingleFile = Annotated[bool, typer.Option("--single-file", help="The report as one file, report.html, to send around.")]
Open = Annotated[bool, typer.Option("--open", help="Open the report in the browser when done.")]


def found(words: tuple[str, ...]) -> tuple[find.Case, ...]:
    """The cases asked for, or the end of the program with exit code 2."""
    try:
        return find.resolve(words)
    except CaseError as error:
        refuse(str(error))


@contextmanager
def sole_writer(out: Path) -> Iterator[None]:
    """Lock the folder while something is written there; an error that the user can put right is shown in one line."""
    with in_one_line(), locked(out):
        yield


def check_limit(seconds: float | None) -> None:
    if seconds is not None and not 0.0 < seconds < inf:
        refuse(f"--time-limit {seconds:g}: give a positive number of seconds")


@contextmanager
def in_one_line() -> Iterator[None]:
    """Show each warning, and the error that ends the command, in one line without a traceback."""
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_: console.print(words(f"warning: {message}", "yellow"), soft_wrap=True)
        try:
            yield
        except BrokenPipeError:  # the reader of the output has closed it
            raise
        except OSError as error:
            refuse(in_words(error))
        except (ValueError, FolderInUseError) as error:
            refuse(str(error))


def refuse(message: str) -> NoReturn:
    console.print(words(message, "red"), soft_wrap=True)
    raise typer.Exit(EXIT_USAGE)
