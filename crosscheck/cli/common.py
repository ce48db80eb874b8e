"""What all commands share: the application, the console, options that several have, and how errors are shown."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from crosscheck.library.case_error import CaseError
from crosscheck.library.own_files import OURS, source_folder
from crosscheck.running.scheduler import TIME_LIMIT_S
from crosscheck.terminal.text import Verbosity, words
from flexmb.output.files import in_words
from flexmb.output.terminal import Terminal
from flexmb.scene.problems import SceneWarning, closest
from flexmb.scene.user_code import forbid_user_code

if TYPE_CHECKING:
    from crosscheck.library.find import Case

EXIT_USAGE = 2
EXIT_INTERRUPTED = 130  # as shells have it

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="""
Run the same multibody scene in independent codes and say who **agrees** with whom, on what, by how much, how fast.

Start with `crosscheck run canonical`, then open the report whose path it prints.
`crosscheck list` shows the cases, `crosscheck engines` the codes that are installed here.

**Exit codes** of every command: 0 all is well; 1 something is not as it should be; 2 the request makes no sense, or a
file cannot be read; 130 interrupted. Errors go to stderr.
""",
)
console = Terminal()
errors = Terminal(stderr=True)


def _show_versions(asked: bool) -> None:
    if asked:
        from crosscheck.terminal.listings import versions_text  # it asks the engines

        typer.echo(versions_text())
        raise typer.Exit


@app.callback()
def everything(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_versions, is_eager=True, help="Show versions, engines' too, and end."),
    ] = False,
) -> None:
    """Has no words of its own: the application's help stands above."""
    try:
        for package in OURS:
            source_folder(package)
    except CaseError as error:
        refuse(str(error))


def _machine_readable(asked: bool) -> bool:
    """Leave stdout to the JSON alone: all else that a command shows goes to stderr."""
    console.stderr = asked
    return asked


def _forbid(asked: bool) -> bool:
    if asked:
        forbid_user_code()  # workers inherit it
    return asked


def _complete_case(begun: str) -> list[str]:
    from crosscheck.library.find import shipped_names  # it reads the names of cases, of nothing else

    return [name for name in shipped_names() if name.startswith(begun)]


def _complete_engine(begun: str) -> list[str]:
    from crosscheck.engines.registry import BUILT_IN, plug_ins

    return [name for name in (*BUILT_IN, *plug_ins()) if name.startswith(begun)]


CaseWords = Annotated[
    list[str],
    typer.Argument(
        help="Case names, patterns such as `'pendulums/*'`, a family, a tag such as `canonical`, `all`, or folders "
        "that hold a run.toml; behind a `!` what to leave out.",
        autocompletion=_complete_case,
    ),
]
CaseWord = Annotated[
    str,
    typer.Argument(help="Case name, a pattern that one case has, or its folder.", autocompletion=_complete_case),
]
EngineWords = Annotated[
    list[str], typer.Argument(metavar="ENGINE...", help="Names of engines.", autocompletion=_complete_engine)
]
EngineNames = Annotated[
    list[str] | None,
    typer.Option(
        "--engine", "-e", autocompletion=_complete_engine,
        help="Only these engines (repeat it). One alone is compared with its partners. fmu:FILE is any FMU.",
    ),
]  # fmt: skip
Json = Annotated[
    bool,
    typer.Option("--json", callback=_machine_readable, help="Print JSON and nothing else on stdout; the rest: stderr."),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Show the last line only, and errors.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Show every comparison and every run.")]

Goals = Annotated[
    list[str] | None,
    typer.Option(
        "--goal", metavar="ENGINE[:CHANNELS]=NUMBER",
        help="A goal that the engine claims instead of the case's, the largest U relative to the range (repeat it).",
    ),
]  # fmt: skip
Efforts = Annotated[
    list[str] | None,
    typer.Option(
        "--efforts", metavar="ENGINE=NUMBER,NUMBER...",
        help="Steps (s) or relative tolerances besides the engine's own, or those of the case (repeat it).",
    ),
]  # fmt: skip
Expect = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="What you claim and expect of your engine; by default `crosscheck-expect.toml`, if there."
    ),
]
Fresh = Annotated[bool, typer.Option("--fresh", help="Forget the records in --out instead of resuming.")]
Out = Annotated[Path, typer.Option("--out", "-o", help="Folder for records, verdicts and report.")]
TimeLimit = Annotated[
    float | None,
    typer.Option(
        "--time-limit", metavar="SECONDS", help=f"Stop what takes longer; default the case's limit or {TIME_LIMIT_S:g}."
    ),
]
MOST_ROUNDS, MOST_JOBS, LONGEST_S = 1000, 4096, 1e7
Rounds = Annotated[
    int, typer.Option("--rounds", min=1, max=MOST_ROUNDS, help="How often each engine, or each effort, is timed.")
]
Jobs = Annotated[
    int | None, typer.Option("--jobs", "-j", min=1, max=MOST_JOBS, help="Jobs at a time; by default one per core.")
]
SchedulerAddress = Annotated[
    str,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="`local`, or the address of a Dask scheduler such as tcp://10.0.0.1:8786; docs/sweeps.md tells more.",
    ),
]
Strict = Annotated[
    bool,
    typer.Option(
        "--strict",
        help="Figures worse than recorded, beyond stale ones or not recorded, references never made, channels that "
        "nothing judges, doubtful scenes: errors.",
    ),
]
NoUserCode = Annotated[
    bool,
    typer.Option(
        "--no-user-code", callback=_forbid, help="Import no function that a scene names, and run no exact.py of a case."
    ),
]
SingleFile = Annotated[bool, typer.Option("--single-file", help="The report as one file, report.html, to send around.")]
Open = Annotated[bool, typer.Option("--open", help="Open the report in the browser when done.")]


def found(words: tuple[str, ...]) -> tuple[Case, ...]:
    """The cases asked for, or the end of the program with exit code 2."""
    from crosscheck.library.find import resolve

    try:
        return resolve(words)
    except CaseError as error:
        refuse(str(error))


def require_engines(names: Iterable[str], broken: bool = False) -> None:
    """End the program with exit code 2 unless all engines that the user names are installed here, and work.

    With `broken` only those that are not installed end it.
    """
    names = tuple(names)
    if not names:
        return
    from crosscheck.running.installed import require_engines as require

    try:
        require(names, broken)
    except CaseError as error:
        refuse(str(error))


def require_variants(cases: tuple[Case, ...], names: Iterable[str]) -> None:
    """End the program with exit code 2 if a variant that the user names is in none of the cases."""
    known = [variant.name for case in cases for variant in case.run.variants]
    for name in names:
        if name not in known:
            refuse(f'no variant "{name}" in {", ".join(case.name for case in cases[:3])}'
                   f'{" and others" if len(cases) > 3 else ""}: {closest(name, set(known))}')  # fmt: skip


def asked(
    cases: Iterable[str], engines: Iterable[str] = (), variants: Iterable[str] = (), time_limit: float | None = None
) -> tuple[Case, ...]:
    """The cases asked for, or the end of the program with exit code 2 at the first word that names nothing.

    Commands call it before they import what runs cases, and engines come first: reading all cases takes seconds.
    """
    check_limit(time_limit)
    require_engines(engines)
    chosen = found(tuple(cases))
    require_variants(chosen, variants)
    return chosen


def claimed(
    cases: tuple[Case, ...],
    expect: Path | None,
    goals: list[str] | None,
    efforts: list[str] | None,
    asked: tuple[str, ...],
) -> tuple[Case, ...]:
    """The cases with what is claimed and expected of engines, or the end of the program with exit code 2."""
    from crosscheck.library.with_claims import expect_file, with_claims

    file = expect_file(expect)
    if file is not None:
        console.print(words(f"Expectations: {file}"), soft_wrap=True)
    try:
        return with_claims(cases, file, goals or (), efforts or (), asked)
    except CaseError as error:
        refuse(str(error))


@contextmanager
def sole_writer(out: Path, strict: bool = False) -> Iterator[None]:
    """Lock the folder while something is written there; an error that the user can put right is shown in one line.

    `strict`: a doubtful scene is an error.
    """
    from crosscheck.records.lock import locked

    with in_one_line(), locked(out):
        if strict:
            warnings.simplefilter("error", SceneWarning)
        yield


def check_limit(seconds: float | None) -> None:
    if seconds is not None and not 0.0 < seconds <= LONGEST_S:
        refuse(f"--time-limit {seconds:g}: give a positive number of seconds, {LONGEST_S:g} at most")


@contextmanager
def in_one_line() -> Iterator[None]:
    """Show each warning once, and the error that ends the command, without a traceback."""
    from crosscheck.records.lock import FolderInUseError

    shown = set[str]()

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        if str(message) not in shown:
            shown.add(str(message))
            errors.print(words(f"warning: {message}", "yellow"), soft_wrap=True)

    with warnings.catch_warnings():
        warnings.showwarning = show
        try:
            yield
        except KeyboardInterrupt:
            console.print(words("interrupted: what was done is recorded, and the same command goes on from there"))
            raise typer.Exit(EXIT_INTERRUPTED) from None
        except OSError as error:
            refuse(in_words(error))
        except (ValueError, FolderInUseError) as error:
            refuse(str(error))


def refuse(message: str) -> NoReturn:
    errors.print(words(message, "red"), soft_wrap=True)
    raise typer.Exit(EXIT_USAGE)


def print_json(content: Any) -> None:
    """Print plain lists, mappings, texts and numbers as JSON on stdout; a number that JSON has not is null."""
    typer.echo(json.dumps(_finite(content), indent=1))


def _finite(content: Any) -> Any:
    if isinstance(content, dict):
        return {str(key): _finite(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_finite(value) for value in content]
    return None if isinstance(content, float) and not isfinite(content) else content


def verbosity(quiet: bool, verbose: bool) -> Verbosity:
    """How much to show; both at once make no sense."""
    if quiet and verbose:
        refuse("--quiet and --verbose contradict each other: give one of them")
    return Verbosity.QUIET if quiet else Verbosity.VERBOSE if verbose else Verbosity.NORMAL
