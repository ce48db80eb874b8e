"""Who holds what: by each variant and channel of a case, the codes beside native that agree, for docs/cases.md.

From the accepted figures of comparisons that expect agreement, and for the variant of the stored reference also from
its routes. Engines of one code have names that begin alike.
"""

import re
from collections.abc import Iterator

from crosscheck.library.find import Case
from crosscheck.library.reference import has_reference, load_reference
from flexmb.run.channels import family

_SIDE = re.compile(r"(?P<engine>.+) \((?P<variant>.+)\)")
_ROUTE = re.compile(r"(?:^U [\d.e+-]+ of|; E [\d.e+-]+ to) (?P<name>[\w.-]+?)(?=[,:;]|$)")
OWN = "native"
FORMULA = "a formula or equations of its own"
Holders = dict[str, dict[str, set[str]]]  # variant -> channel -> codes


def holders(case: Case) -> Holders:
    """The codes beside native, in the variants that native runs."""
    found: Holders = {}
    expected = {comparison.name for comparison in case.run.comparisons if comparison.expect == "agree"}
    for name, table in case.accepted.items():
        for place in table if name in expected else ():
            channel, *sides = place.split(" | ")
            both = [match.groups() for side in sides if (match := _SIDE.fullmatch(side))]
            for engine, variant in both:
                if _code(engine) == OWN:
                    others = {_code(other) for other, _ in both} - {OWN}
                    found.setdefault(variant, {}).setdefault(channel, set()).update(others)
    if has_reference(case.folder):
        knowledge = load_reference(case.folder).knowledge
        for channel, known in knowledge.channels.items():
            others = {_code(match["name"]) for match in _ROUTE.finditer(known.how)} - {OWN}
            found.setdefault(knowledge.variant, {}).setdefault(channel, set()).update(others)
    return found


def _code(engine: str) -> str:
    return FORMULA if engine.endswith(".py") else engine.partition("-")[0]


def words(case: Case) -> Iterator[str]:
    """A line of a list for each variant."""
    for variant, channels in sorted(holders(case).items()):
        groups: dict[tuple[str, ...], list[str]] = {}
        for channel, codes in channels.items():
            groups.setdefault(tuple(sorted(codes)), []).append(channel)
        *few, (codes, members) = sorted(groups.items(), key=lambda item: (len(item[1]), item[0]))
        rest = f"{'the others' if few else 'all'} ({len(members)}) {_by(codes)}"
        yield f"- *{variant}*: {'; '.join([*(f'{_named(own, channels)} {_by(by)}' for by, own in few), rest])}"


def _by(codes: tuple[str, ...]) -> str:
    return f"by {', '.join(codes)}" if codes else "by methods of native alone"


def _named(members: list[str], channels: dict[str, set[str]]) -> str:
    """The channels of a group; a whole family under its name."""
    by_family: dict[str, list[str]] = {}
    for channel in members:
        by_family.setdefault(family(channel), []).append(channel)
    names = []
    for each, own in by_family.items():
        whole = len(own) == sum(family(channel) == each for channel in channels)
        names += [f"`{each}` ({len(own)})"] if whole and len(own) > 1 else [f"`{channel}`" for channel in own]
    return ", ".join(names)
