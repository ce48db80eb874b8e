"""Writing both files of a reference, or none."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import msgspec
import tomlkit

from crosscheck.library.reference import KNOWLEDGE, VALUES, Knowledge
from flexmb.output.whole import whole_file, write_whole

HEADER = "Written by `crosscheck regenerate`, with reference.csv; nobody edits it. docs/references.md explains it."


def knowledge_text(knowledge: Knowledge) -> str:
    """The text of reference.toml."""
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
    """Write both files; if one cannot be written, both remain as they were. OSError names the file.

    They are renamed one right after the other. If the process is killed in between, reading them notices it:
    reference.toml holds the digest of the values that it belongs to.
    """
    texts = {folder / VALUES: values, folder / KNOWLEDGE: knowledge}
    before = {file: file.read_bytes() if file.exists() else None for file in texts}
    try:
        with ExitStack() as together:
            for file, text in texts.items():
                together.enter_context(whole_file(file)).write_bytes(text.encode("utf-8"))
    except BaseException:
        for file, content in before.items():
            if content is None:
                file.unlink(missing_ok=True)
            elif file.read_bytes() != content:
                write_whole(file, content)
        raise
