"""Finding and reading case folders, shipped ones and the user's."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

from crosscheck.library.accepted import FILE as ACCEPTED
from crosscheck.library.accepted import Accepted
from crosscheck.library.case import CaseError, Provenance, RunFile, Variant
from crosscheck.library.case_words import chosen, meant
from crosscheck.library.check import check_accepted, check_provenance, check_run_file
from crosscheck.library.claims import Claims
from crosscheck.library.own_files import source_folder
from crosscheck.library.read_file import struct_of, text_of
from flexmb.scene.files import load_scene
from flexmb.scene.reading import parse_toml
from flexmb.scene.schema import Scene


@dataclass(frozen=True)
class Case:
    """A case folder that was read and checked. `name` is "<family>/<case>".

    `alone`: engines are compared with the stored reference only, and no partners run. `envelopes`: the library's own
    engines follow each run once more, for its peaks over all steps. `claims` are those of
    `crosscheck.library.expect_file` on the engines.
    """

    name: str
    folder: Path
    run: RunFile
    provenance: Provenance | None
    readme: str
    accepted: Accepted = field(default_factory=dict)
    alone: bool = False
    envelopes: bool = False
    claims: Claims = field(default_factory=Claims)

    def scene(self, variant: Variant) -> Scene:
        """The variant's scene as its file says, before any transformation."""
        return load_scene(self.folder / variant.scene)


def shipped_folder() -> Path:
    """Folder of the shipped cases: package data of an installed wheel, or `cases/` beside the package in a checkout."""
    package = source_folder("crosscheck")
    packaged = package / "cases"
    return packaged if packaged.is_dir() else package.resolve().parent / "cases"


def shipped_cases() -> tuple[Case, ...]:
    """Every shipped case, by name."""
    return tuple(load_case(path.parent) for path in sorted(shipped_folder().glob("*/*/run.toml")))


def shipped_names() -> tuple[str, ...]:
    """Names of the shipped cases; none of their files is read."""
    folders = (path.parent for path in sorted(shipped_folder().glob("*/*/run.toml")))
    return tuple(f"{folder.parent.name}/{folder.name}" for folder in folders)


def shipped_tags() -> dict[str, tuple[str, ...]]:
    """The tags of the shipped cases by name; nothing else of them is checked, and a wrong word is refused at once."""
    run_files = {name: parse_toml(text_of(shipped_folder() / name / "run.toml")) for name in shipped_names()}
    return {name: tuple(run_file.get("tags", ())) for name, run_file in run_files.items()}


def resolve(words: tuple[str, ...]) -> tuple[Case, ...]:
    """The cases that a user asks for: by words (`crosscheck.library.case_words`), or by folders with a run.toml.

    CaseError also for two folders whose cases have the same name: records and report could not tell them apart.
    """
    found: dict[str, Case] = {}

    def one(word: str) -> tuple[str, ...]:
        cases = _resolve_one(word)
        for case in cases:
            other = found.setdefault(case.name, case)
            if other.folder != case.folder:
                raise CaseError(
                    f"{other.folder} and {case.folder} are both called {case.name}: rename a folder, or run one alone"
                )
        return tuple(case.name for case in cases)

    return tuple(found[name] for name in chosen(words, one))


def _resolve_one(word: str) -> tuple[Case, ...]:
    folder = Path(word)
    if os.path.isfile(folder / "run.toml"):  # False also for words that cannot be a path
        return (load_case(folder),)
    return tuple(load_case(shipped_folder() / name) for name in meant(word, shipped_names(), shipped_tags))


def load_case(folder: Path) -> Case:
    """Read and check a case folder; CaseError names file, place and remedy."""
    folder = folder.resolve()
    run = struct_of(folder / "run.toml", RunFile)
    try:
        check_run_file(run)
    except CaseError as error:
        raise CaseError(f"{folder / 'run.toml'}: {error}") from None
    for variant in run.variants:
        if not os.path.isfile(folder / variant.scene):
            missing = f'variant "{variant.name}" needs {variant.scene}, which is not there'
            raise CaseError(f"{folder / 'run.toml'}: {missing}")
    accepted: Accepted = {}
    if _present(folder / ACCEPTED):
        accepted = struct_of(folder / ACCEPTED, Accepted)
        try:
            check_accepted(accepted, run)
        except CaseError as error:
            raise CaseError(f"{folder / ACCEPTED}: {error}") from None
    provenance_file, readme = folder / "provenance.toml", folder / "README.md"
    provenance: Provenance | None = None
    if _present(provenance_file):
        provenance = struct_of(provenance_file, Provenance)
        try:
            check_provenance(provenance)
        except CaseError as error:
            raise CaseError(f"{provenance_file}: {error}") from None
    return Case(
        name=f"{folder.parent.name}/{folder.name}",
        folder=folder,
        run=run,
        provenance=provenance,
        readme=text_of(readme) if _present(readme) else "",
        accepted=accepted,
    )


def _present(file: Path) -> bool:
    """Whether the file exists, even if it cannot be read, so that reading reports the error."""
    return os.path.lexists(file)
