"""Why rows are missed: what a profile says, for readers of the page. What is met needs no reason and shows none."""

from __future__ import annotations

from typing import NamedTuple


class Reason(NamedTuple):
    """One text for rows that are missed for the same reason."""

    rows: tuple[str, ...]
    text: str


REASONS = (
    Reason(
        ("growth_chain_1000_100000", "growth_star_1000_100000", "growth_binary_tree_1000_100000"),
        "memory. A body takes 1.4 kB of constants and states, which three passes read and write: a thousand bodies lie "
        "in the cache, a hundred thousand stream from memory at some 15 GB/s. The faster the kernel, the larger the "
        "ratio.",
    ),
)
