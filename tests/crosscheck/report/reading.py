"""Reading what a page's scripts read."""

import base64
import json
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np


def data_of(script: Path) -> dict[str, Any]:
    """What a script registers for its case."""
    registered = re.fullmatch(r'crosscheck\.register\("case-\d+", (.*)\);\s*', script.read_text(encoding="utf-8"))
    return json.loads(registered.group(1))


def series_of(packed: dict[str, Any]) -> list[np.ndarray]:
    """All series, each (rows, columns): the inverse of `Store.packed`."""
    raw = zlib.decompress(base64.b64decode(packed["data"]))
    differences = np.frombuffer(raw, dtype=np.uint8).reshape(4, -1).T.copy().view("<u4")[:, 0]
    found, at = [], 0
    for rows, columns in packed["shapes"]:
        stream = differences[at : at + rows * columns].reshape(columns, rows)
        found.append(np.cumsum(stream, axis=1, dtype="<u4").view("<f4").T)
        at += rows * columns
    return found
