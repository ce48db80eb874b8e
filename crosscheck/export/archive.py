"""The files of a release: every case as data, in other formats, with its reference; schemas, citation, checksums.

Everything is text, built in memory from the files of the cases alone, so that the same cases give the same bytes.
"""

from __future__ import annotations

import csv
import errno
import hashlib
import io
import json
import os
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from crosscheck.export.formats.exudyn_script import exudyn_script
from crosscheck.export.formats.mjcf import mjcf
from crosscheck.export.formats.urdf import urdf
from crosscheck.export.formats.written import Written
from crosscheck.export.metadata import case_page, citation_cff, collection_page, datacite, zenodo
from crosscheck.export.model import modal_file, model_data
from crosscheck.export.schemas import schema_files
from crosscheck.library.case_error import CaseError
from crosscheck.library.find import Case, shipped_folder
from crosscheck.library.read_file import text_of
from crosscheck.library.reference import VALUES, StoredReference, current_reference, values_text
from crosscheck.running.plan import variant_scene
from flexmb.output.files import as_text, check_folder, folder, write_whole
from flexmb.run.channels import unit
from flexmb.scene.problems import SceneError

SUMS = "SHA256SUMS"
PROGRAM = "rebuild"
OTHERS = {"urdf": (urdf, "model.urdf"), "mjcf": (mjcf, "model.mjcf.xml"), "exudyn": (exudyn_script, "model_exudyn.py")}
"""Formats of other programs: the writer and the file."""


def archive(cases: Sequence[Case]) -> dict[str, str]:
    """The text of every file of a release by its path, with "/" on every system.

    CaseError names what cannot be exported.
    """
    texts: dict[str, str] = {}
    rows = []
    for case in cases:
        own, others = case_files(case)
        texts |= {f"{case.name}/{name}": text for name, text in own.items()}
        rows.append((case, others))
    texts |= {f"schemas/{name}": text for name, text in schema_files().items()}
    texts |= {
        "README.md": collection_page(rows),
        "LICENSE": text_of(shipped_folder() / "LICENSE"),
        "CITATION.cff": citation_cff(),
        "datacite.json": datacite(cases),
        ".zenodo.json": zenodo(cases),
    }
    for file in files("crosscheck.export").joinpath(PROGRAM).iterdir():
        if file.name.endswith(".py"):
            texts[f"{PROGRAM}/{file.name}"] = file.read_text(encoding="utf-8")
    return dict(sorted(texts.items())) | {SUMS: checksums(texts)}


def case_files(case: Case) -> tuple[dict[str, str], dict[str, Written]]:
    """The files of one case by name, and what each other format makes of it."""
    reference = current_reference(case)
    variant = case.run.variant(reference.knowledge.variant)
    try:
        scene = variant_scene(case.scene(variant), variant)
        data, modal = model_data(scene)
    except (SceneError, CaseError) as error:
        raise CaseError(f"{case.name}: {error}") from None
    files = {"model.json": _json(data)}
    for body, content in modal.items():
        name = modal_file(body)
        if name in files:
            raise CaseError(f'{case.name}: body "{body}" and another one would be written to {name}: rename one')
        files[name] = _json(content)
    others = {kind: writer(scene, case.name.replace("/", "_")) for kind, (writer, _) in OTHERS.items()}
    for kind, written in others.items():
        if written.text:
            files[OTHERS[kind][1]] = written.text
    files[VALUES] = values_text(reference.times, reference.channels)
    files["uncertainty.csv"] = uncertainty_text(reference)
    files["README.md"] = case_page(case, reference, others, {kind: file for kind, (_, file) in OTHERS.items()})
    return files, others


def uncertainty_text(reference: StoredReference) -> str:
    """The table of error bars: one row a channel."""
    text = io.StringIO()
    rows = csv.writer(text, quoting=csv.QUOTE_ALL, lineterminator="\n")
    rows.writerow(["channel", "unit", "uncertainty", "range", "how"])
    for channel, known in reference.knowledge.channels.items():
        symbol = "rad" if channel.endswith(".orientation") else unit(channel)
        rows.writerow([channel, symbol, repr(known.uncertainty), repr(known.scale), as_text(known.how)])
    return text.getvalue()


def checksums(texts: dict[str, str]) -> str:
    """What `sha256sum --check` reads."""
    lines = (f"{hashlib.sha256(text.encode()).hexdigest()}  {name}\n" for name, text in sorted(texts.items()))
    return "".join(lines)


def write_archive(texts: dict[str, str], out: Path) -> None:
    """Write the files into an empty or new folder, the checksums last: without them an archive is not whole.

    OSError names a folder that is not empty, or what could not be written.
    """
    check_empty(out)
    for name, text in texts.items():
        place = folder(out).joinpath(*name.split("/"))
        folder(place.parent)
        write_whole(place, text)


def check_empty(out: Path) -> None:
    """OSError unless the folder is empty or can be made."""
    check_folder(out)
    if out.is_dir() and any(out.iterdir()):
        raise OSError(errno.ENOTEMPTY, f"{os.strerror(errno.ENOTEMPTY)}: name a new one, or empty it", str(out))


def _json(content: object) -> str:
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
