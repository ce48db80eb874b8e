"""The words by which cases are meant: one grammar for every command, the pytest plug-in, the action, expectations.

A word is

- `all`;
- a name, `pendulums/compound`, or its last part, `compound`;
- a shell pattern of names, `pendulums/*`;
- a family, `pendulums`, which is all names that begin with it, or a tag, `canonical`;
- any of these behind a `!`, which leaves out what the words before it meant: `all '!stiff/*'`.

Commands take the path of a folder with a `run.toml` too, which `crosscheck.library.find.resolve` looks for first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from fnmatch import fnmatchcase

from crosscheck.library.case_error import CaseError
from flexmb.scene.problems import closest

ALL, NOT = "all", "!"
PATTERN_SIGNS = "*?["
Tags = Callable[[], Mapping[str, Iterable[str]]]
"""Gives the tags of each case by its name; only called where names do not decide, as it reads the cases."""


def meant(word: str, names: Iterable[str], tags: Tags) -> tuple[str, ...]:
    """The names that a word without `!` means. CaseError if there is none, with the nearest word that there is."""
    names = tuple(names)
    if word == ALL:
        return names
    if any(sign in word for sign in PATTERN_SIGNS):
        matching = tuple(name for name in names if fnmatchcase(name, word))
        if not matching:
            raise CaseError(f'"{word}" is a pattern of names that no case has. `crosscheck list` shows them all.')
        return matching
    named = tuple(name for name in names if word in (name, _last(name)))
    if named:
        return named
    tagged = tags()
    matching = tuple(name for name in names if word == _family(name) or word in tagged[name])
    if not matching:
        known = {word for name in names for word in (name, _last(name), _family(name), *tagged[name])} | {ALL}
        raise CaseError(
            f'"{word}" is no case, no family, no tag and no folder with a run.toml: {closest(word, known)}. '
            "`crosscheck list` shows them all."
        )
    return matching


def chosen(words: Iterable[str], one: Callable[[str], Iterable[str]]) -> tuple[str, ...]:
    """The names that words mean together, by what `one` of them means.

    CaseError for a `!` that leaves out nothing, as a misspelt word would, and if nothing remains.
    """
    words = tuple(words)
    cases: dict[str, None] = {}
    for word in words:
        if not word.startswith(NOT):
            cases |= dict.fromkeys(one(word))
            continue
        out = [name for name in one(word.removeprefix(NOT)) if name in cases]
        if not out:
            raise CaseError(f'"{word}" leaves out nothing that the words before it mean: write it behind them')
        for name in out:
            del cases[name]
    if words and not cases:
        raise CaseError(f"{' '.join(words)}: no case remains")
    return tuple(cases)


def _family(name: str) -> str:
    return name.partition("/")[0]


def _last(name: str) -> str:
    return name.partition("/")[2]
