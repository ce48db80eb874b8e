"""What results show at an interactive prompt: a few lines, whatever their size."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

SHOWN = 6  # numbers of an array, or members of a sequence, that are shown themselves
LETTERS = 60  # of a text, or of a member


def brief(result: Any) -> str:
    """The class of a dataclass and its fields; of large arrays the shape, of tables and long sequences the size."""
    fields = [field for field in dataclasses.fields(result) if field.repr]
    shown = [f"{field.name}={_shown(getattr(result, field.name))}" for field in fields]
    return f"{type(result).__name__}({', '.join(shown)})"


def _shown(value: Any) -> str:
    if isinstance(value, np.ndarray):
        if value.size <= SHOWN:
            return str(value.tolist())
        return f"<{value.dtype.name} {' x '.join(map(str, value.shape))}>"
    if isinstance(value, str):
        return repr(value) if len(value) <= LETTERS else f"{value[: LETTERS - 3]!r}..."
    if isinstance(value, Mapping):
        return f"<{len(value)} by name>" if value else "{}"
    if isinstance(value, Sequence):
        members = [_shown(member) for member in value[:SHOWN]]
        if len(value) <= SHOWN and sum(map(len, members)) <= LETTERS:
            return f"({', '.join(members)})"
        return f"<{len(value)} of {type(value[0]).__name__}>"
    text = repr(value)
    return text if len(text) <= 2 * LETTERS and "\n" not in text else f"<{type(value).__name__}>"
