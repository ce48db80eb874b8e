"""Words of `flexmb reduce` for nodes: 1-20,31, and surfaces that are tied to one: 900=1-20 or 900@0.1,0,0=1-20."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from flexmb.interchange.superelement import Tie

MANY = 8_000  # nodes in a range: more than a structure can have


def numbers_of(option: str, words: str) -> list[int]:
    """Numbers of nodes; ValueError, which names the option."""
    numbers = list[int]()
    for word in words.split(","):
        first, to, last = word.partition("-")
        try:
            start, stop = int(first), int(last if to else first)
        except ValueError:
            raise ValueError(f"{option} is numbers of nodes such as 1,12 or 1-20; got {words!r}") from None
        if not 0 <= stop - start < MANY:
            raise ValueError(f"{option}: {word} is not a range of at most {MANY} nodes, from the lower to the higher")
        numbers += range(start, stop + 1)
    return numbers


def tie_of(kind: Literal["rigid", "mean"], words: str) -> Tie:
    """A surface and the node that it is tied to; ValueError, which names the option."""
    from flexmb.interchange.superelement import Tie

    head, _, surface = words.partition("=")
    node, at, place = head.partition("@")
    try:
        x, y, z = map(float, place.split(",")) if at else (0.0, 0.0, 0.0)
        number = int(node)
    except ValueError:
        raise ValueError(f"--{kind} is a new node and its surface, 900=1-20 or 900@X,Y,Z=1-20; got {words!r}") from None
    return Tie(number, tuple(numbers_of(f"--{kind}", surface)), kind, (x, y, z) if at else None)
