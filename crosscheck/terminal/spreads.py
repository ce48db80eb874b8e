"""Spreads of channels under moved inputs, on the terminal."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from flexmb.output.listing import Listing, figures, names

if TYPE_CHECKING:
    from crosscheck.sampling.printed import VariantSpreads


def spreads_table(case: str, found: Iterable[VariantSpreads], everything: bool) -> Listing:
    """A row for each channel, or for that with the largest spread by digits of each kind of channel."""
    table = Listing(
        *names("variant", "channel"), *figures("inputs moved", "held", "2 ulp", "digits", "E", "U", "goal"), title=case
    )
    for of in found:
        largest: dict[str, str] = {}
        for name, spread in of.channels.items():
            kind = name if everything else f"{name.partition(':')[0]}.{name.rpartition('.')[2]}"
            if kind not in largest or spread.digits > of.channels[largest[kind]].digits:
                largest[kind] = name
        for name in largest.values():
            each = of.channels[name]
            numbers = (each.ulp, each.digits, each.E, each.U, each.goal)
            cells = ("" if number is None else f"{number:.1e}" for number in numbers)
            table.add(of.variant, name, str(of.moved), str(len(of.held)), *cells)
    return table
