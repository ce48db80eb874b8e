"""Writing a reference: both of its files, or none."""

from __future__ import annotations

import os
from pathlib import Path

import msgspec
import tomlkit

from crosscheck.library.reference import KNOWLEDGE, VALUES, Knowledge
from flexmb.output.writing import writing

HEADER = "Written by `crosscheck regenerate`, with reference.csv; nobody edits it. docs/references.md explains it."


def knowledge_text(knowledge: Knowledge) -> str:
    """The text of reference.toml, a table a channel."""
    document = tomlkit.document()
    document.add(tomlkit.comment(HEADER))
    for key, value in msgspec.to_builtins(knowledge).items():
        if isinstance(value, list | tuple):
            rows = tomlkit.array()
            rows.extend(value)
            document[key] = rows.multiline(True)
        else:
            document[key] = value
    return tomlkit.dumps(document)


def write_both(folder: Path, values: str, knowledge: str) -> None:
    """Put both files in place; where that fails, neither is there that was not there before. OSError names the file."""
    texts = {folder / VALUES: values, folder / KNOWLEDGE: knowledge}
    fresh = {file: file.with_name(f".{file.name}.new") for file in texts}
    before = {file: file.read_bytes() if file.exists() else None for file in texts}
    try:
        for file, text in texts.items():
            with writing(file):
                fresh[file].write_text(text, encoding="utf-8", newline="")
        for file, made in fresh.items():
            with writing(file):
                os.replace(made, file)
    except BaseException:
        for file, content in before.items():
            fresh[file].unlink(missing_ok=True)
            if content is None:
                file.unlink(missing_ok=True)
            elif file.read_bytes() != content:
                file.write_bytes(content)
        raise
