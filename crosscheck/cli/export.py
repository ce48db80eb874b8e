"""`crosscheck export`: the library as an archive that others can use without our code."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from crosscheck.cli import common
from crosscheck.terminal.text import marked


@common.app.command()
def export(
    cases: common.CaseWords,
    out: Annotated[Path, typer.Option("--out", "-o", help="A new or empty folder for the archive.")],
) -> None:
    """
    Write cases as a release that needs none of our code.

    `cases` and `all` are every shipped case, a pattern such as `'pendulums/*'` those that it matches. **Writes** for
    each case `model.json`, the data of its equations of motion, with `modal/BODY.json` for flexible bodies; URDF, MJCF
    and an Exudyn script where these hold the mechanism exactly; `reference.csv` and `uncertainty.csv`, the motion with
    its error bars; and a README. Beside them `rebuild/`, which reads a case by NumPy and SciPy alone, JSON schemas,
    licence, citation, metadata for archives and `SHA256SUMS`. The same cases give the same bytes. `docs/export.md`
    explains every key.

    **Exit code**: 0 all is written; 2 the folder is not empty, or a case cannot be exported: then nothing is written.

    **Examples**: `crosscheck export cases --out release` · `crosscheck export 'pendulums/*' tops/lagrange -o some`
    """
    from crosscheck.export.archive import archive, check_empty, write_archive

    with common.in_one_line():
        check_empty(out)
        texts = archive(common.found(tuple("all" if word == "cases" else word for word in cases)))
        write_archive(texts, out)
    size = sum(len(text.encode()) for text in texts.values()) / 2**20
    common.console.print(marked("✓", "green", f"{len(texts)} files, {size:.1f} MiB, in {out}"), soft_wrap=True)
