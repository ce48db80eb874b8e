"""The numbers of a scene: types that say which values a key takes and, where its name does not, in which unit.

`flexmb.scene.keys` reads what they say. From it follow the check of every number (`flexmb.scene.check.numbers`), the
limits in the JSON Schema, and the columns of the reference page.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Annotated, Any

from msgspec import Meta

# Larger than any quantity of mechanics in SI units; products of five such numbers are still finite.
LARGEST = 1e60


@dataclass(frozen=True)
class Range:
    """The numbers from `least` to `most` without `excluded`; both are finite except for counts.

    `noun` and `remedy` stand in messages in place of those that are made from the key. With a `waiver` a number outside
    is doubtful only, and this word in the scene's `allow` admits it.
    """

    least: float = -LARGEST
    most: float = LARGEST
    excluded: float | None = None
    noun: str = ""
    remedy: str = ""
    waiver: str = ""

    def holds(self, number: float) -> bool:
        """Whether a number is inside; NaN is not."""
        return self.least <= number <= self.most and number != self.excluded

    def __str__(self) -> str:
        """As mathematics writes it: "> 0", "≥ 0", "0 to 1", "≠ 0"; "" for all finite numbers."""
        if self.least == -LARGEST:
            return "" if self.excluded is None else f"≠ {self.excluded:g}"
        if self.most < LARGEST:
            return f"{self.least:g} to {self.most:g}"
        return f"> {self.least:g}" if self.excluded == self.least else f"≥ {self.least:g}"

    def words(self, noun: str) -> str:
        """What to give instead of a number outside."""
        if self.excluded == self.least:
            return f"give a positive {noun}"
        if self.most < LARGEST:
            return f"give {self}"
        return f"give a {noun} of at least zero" if self.least == 0.0 else f"give {self.least:g} at least"

    def keywords(self) -> dict[str, Any]:
        """Keywords of JSON Schema: none for a number outside that is only doubtful."""
        words: dict[str, Any] = {}
        if self.waiver:
            return words
        if self.least > -LARGEST:
            words["exclusiveMinimum" if self.excluded == self.least else "minimum"] = self.least
        elif self.excluded is not None:
            words["not"] = {"const": self.excluded}
        if self.most < LARGEST:
            words["maximum"] = self.most
        return words


FINITE = Range()


def within(
    least: float = -LARGEST, most: float = LARGEST, *, excluded: float | None = None, noun: str = "",
    remedy: str = "", waiver: str = "",
) -> Meta:  # fmt: skip
    """What a type says of its real numbers, see Range."""
    allowed = Range(least, most, excluded, noun, remedy, waiver)
    return Meta(extra={"range": allowed}, extra_json_schema=allowed.keywords())


def whole(least: int, most: float = inf, *, noun: str = "", remedy: str = "") -> Meta:
    """What a type says of its whole numbers, which Python holds however large they are."""
    allowed = Range(least, most, None, noun, remedy)
    return Meta(extra={"range": allowed, "unit": "1"}, extra_json_schema=allowed.keywords())


def unit(symbol: str) -> Meta:
    """The unit of a key that does not end in it; "1" is that of pure numbers."""
    return Meta(extra={"unit": symbol})


PURE = unit("1")
UNIT_LENGTH = Meta(extra={"unit_length": True, "unit": "1"})

Number = Annotated[float, within()]
Positive = Annotated[float, within(0.0, excluded=0.0)]
NotNegative = Annotated[float, within(0.0)]
Time = Annotated[float, within(0.0, remedy="give a time that is not negative")]
Stiffness = Annotated[float, within(0.0, waiver="negative_stiffness")]
Damping = Annotated[float, within(0.0, waiver="negative_damping")]
Lump = Annotated[float, within(0.0, excluded=0.0, remedy="give a positive mass, or leave the item out")]
