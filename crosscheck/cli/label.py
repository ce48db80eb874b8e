"""`crosscheck label`: the credibility of cases, factor by factor, with the files that stand behind each."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from crosscheck.cli import common

if TYPE_CHECKING:
    from crosscheck.label.evidence import Labelled


@common.app.command()
def label(
    words: Annotated[
        list[str],
        typer.Argument(
            metavar="CASE|SET|SESSION...",
            help="Cases as for `run`, measured sets as for `validate`, or folders of sessions: all of their cases.",
        ),
    ],
    evidence: Annotated[
        Path,
        typer.Option("--evidence", metavar="FOLDER", help="Where results.json, sensitivity.json, validation.json are."),
    ] = Path("out"),
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE", help="Write the label as JSON, sealed.")
    ] = None,
    verbose: common.Verbose = False,
    as_json: common.Json = False,
    no_user_code: common.NoUserCode = False,
) -> None:
    """
    Show the credibility of cases by the eight factors of NASA-STD-7009B, and what stands behind each level.

    A level from 0 to 4 is computed from files alone: the case's folder, and in `--evidence` the results of `crosscheck
    run`, `crosscheck sensitivity --out` and `crosscheck validate --out`. A file counts while scene, references and code
    are those that it was made of; one that is stale or was changed counts as none, and is named. Nothing is run. What
    would raise a level stands beside it. `--verbose` shows all files that were looked at. `docs/credibility.md` has the
    rules.

    `crosscheck run` writes the same into its folder: `label.json`, a table in `summary.md` and on the pages of cases.
    run.toml may state `intended_use`, `limits` and `waivers`, which are shown and change no level.

    **Exit code**: 0; 2 there is no such case, set or session, or its files are wrong.

    **Examples**: `crosscheck label pendulums/double` · `crosscheck label out --verbose` ·
    `crosscheck label pazy_wing --evidence validation --json`
    """
    subjects, folder = _session(words) or (_subjects(words), evidence)
    from crosscheck.label.document import LabelFile, label, label_text, write_label
    from crosscheck.label.evidence import evidence as gathered
    from crosscheck.library.own_files import code_here
    from crosscheck.terminal.listings import label_table, levels_table

    labels = LabelFile(code=code_here(), subjects={each.name: label(each, gathered(each, folder)) for each in subjects})
    if len(labels.subjects) > 1:
        common.console.print(levels_table(labels))
    if len(labels.subjects) == 1 or verbose:
        for name, each in labels.subjects.items():
            common.console.print(label_table(name, each, verbose))
    if out is not None:
        with common.in_one_line():
            write_label(labels, out)
        common.console.print(f"Label: {out}", soft_wrap=True, markup=False)
    if as_json:
        common.print_json(json.loads(label_text(labels)))


def _session(words: list[str]) -> tuple[list[Labelled], Path] | None:
    """The cases of a session's folder, and the folder; None if the words are something else."""
    from crosscheck.sealed.seal import FILE, ResultsError, read_finished

    folders = [Path(word) for word in words if (Path(word) / FILE).is_file()]
    if not folders:
        return None
    if len(words) > 1:
        common.refuse("a session is labelled alone: give one folder, or cases with --evidence")
    try:
        names = list(read_finished(folders[0] / FILE).cases)
    except ResultsError as error:
        common.refuse(str(error))
    return _subjects([_place(name, folders[0]) for name in names]), folders[0]


def _place(name: str, session: Path) -> str:
    """A case of a session as a word: its folder where `crosscheck run` made it from a scene, else its name."""
    made = session / "cases" / name.rpartition("/")[2]
    return str(made) if name.startswith("cases/") and made.is_dir() else name


def _subjects(words: list[str]) -> list[Labelled]:
    """Cases and measured sets; exit code 2 at the first word that is neither."""
    from crosscheck.label.evidence import of_case, of_measured_set
    from crosscheck.validation.measured_set import FILE, find_sets, shipped_sets

    def is_set(word: str) -> bool:
        folder = Path(word)
        return word in known or ((folder / FILE).is_file() and not (folder / "run.toml").is_file())

    known = shipped_sets()
    sets, cases = [word for word in words if is_set(word)], [word for word in words if not is_set(word)]
    found = [of_case(case) for case in common.asked(cases)] if cases else []
    with common.in_one_line():
        return [*found, *(of_measured_set(each.name, each.content.title, each.folder) for each in find_sets(sets))]
