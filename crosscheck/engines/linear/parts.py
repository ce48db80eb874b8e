"""What can be asked of the linearised motion, by name. This file imports nothing, as every command reads it."""

from __future__ import annotations

from typing import Literal

LinearPart = Literal["derivatives", "frequencies"]
DERIVATIVES = ("by_displacement", "by_speed", "by_force")
FREQUENCIES = "frequencies"
