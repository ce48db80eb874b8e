"""Cases with the claims that a user makes by a file and by options."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

from crosscheck.engines.registry import BUILT_IN, plug_ins
from crosscheck.library.claims import claims_on
from crosscheck.library.expect_file import NAME, efforts_option, goal_option, read_expect_file
from crosscheck.library.find import Case, shipped_names, shipped_tags


def expect_file(given: Path | None) -> Path | None:
    """The file of expectations that counts: the one that is given, else the one in the working folder, if there is."""
    return given if given is not None else Path(NAME) if Path(NAME).exists() else None


def with_claims(
    cases: Sequence[Case],
    file: Path | None = None,
    goals: Sequence[str] = (),
    efforts: Sequence[str] = (),
    asked: Sequence[str] = (),
) -> tuple[Case, ...]:
    """The cases with what a `file` and the options `--goal` and `--efforts` say; options come after the file.

    `asked` are the engines asked for, which may be named even if there is no such engine. CaseError names the place of
    everything that is wrong.
    """
    written = {} if file is None else {str(file): read_expect_file(file)}
    written |= {f"--goal {text}": goal_option(text) for text in goals}
    written |= {f"--efforts {text}": efforts_option(text) for text in efforts}
    if not written:
        return tuple(cases)
    own = {case.name: case.run.tags for case in cases}

    @cache
    def tags() -> dict[str, tuple[str, ...]]:
        return shipped_tags() | own

    of_cases = (engine for case in cases for variant in case.run.variants for engine in variant.engines + variant.also)
    claims = claims_on(
        tuple(own),
        written,
        names=tuple(dict.fromkeys((*shipped_names(), *own))),
        tags=tags,
        engines=tuple(dict.fromkeys((*BUILT_IN, *plug_ins(), *asked, *of_cases))),
    )
    return tuple(replace(case, claims=claims[case.name]) for case in cases)
