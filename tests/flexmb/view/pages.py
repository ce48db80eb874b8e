"""Pages read as the browser reads them."""

import base64
import json
import re
import zlib
from typing import Any

import numpy as np

from flexmb.typing import Real


def unpacked(html: str) -> tuple[dict[str, Any], list[Real]]:
    """The data of a page, and its series (T,k)."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.DOTALL)
    assert found is not None
    data = json.loads(found[1])
    planes = np.frombuffer(zlib.decompress(base64.b64decode(data["series"]["data"])), np.uint8).reshape(4, -1)
    differences, at, series = np.ascontiguousarray(planes.T).view("<u4").ravel(), 0, []
    for rows, columns in data["series"]["shapes"]:
        bits = differences[at : at + rows * columns].reshape(columns, rows).cumsum(axis=1, dtype=np.uint32)
        series.append(bits.view("<f4").T.astype(float))
        at += rows * columns
    return data, series
