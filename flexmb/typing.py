"""Names of array types: shapes stand in docstrings, as (rows, columns)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Index = NDArray[np.int64]
Flags = NDArray[np.bool_]
Record = NDArray[np.void]
