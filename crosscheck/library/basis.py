"""What a stored reference rests on: the codes and formulas among its routes, and the word that follows from them.

A reference tells its routes as texts, `title`, and everything here is read from those texts: what a page or a report
calls a case cannot drift from what was run. Engines of one code have names that begin alike (`native`,
`native-composite`), so that agreement among them is that of formulations and integrators, not of codes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from crosscheck.library.case import ReferenceKind

CLOSED_FORM, OWN_EQUATIONS = "a closed form", "equations of its own"
MANUFACTURED = "a manufactured motion"
FORMULAS = (CLOSED_FORM, MANUFACTURED, OWN_EQUATIONS)
WITNESS = "a witness"


def title(name: str, how: str, witness: bool) -> str:
    """The text of a route: an engine with its efforts, or a file of the case with what it is."""
    return ", ".join([name, how, *([WITNESS] if witness else [])])


@dataclass(frozen=True)
class Basis:
    """`codes` are those of the engines, without repetition; `formulations` the engines themselves; `witnesses` those
    codes, or `OWN_EQUATIONS`, that only have to agree."""

    closed_form: bool
    own_equations: bool
    codes: tuple[str, ...]
    formulations: tuple[str, ...]
    witnesses: tuple[str, ...] = ()

    @property
    def alone(self) -> bool:
        """Whether one code alone says what the numbers are."""
        return len(self.codes) == 1 and not self.closed_form and not self.own_equations

    @property
    def kind(self) -> ReferenceKind:
        """What the routes are by themselves, without any published number."""
        if self.closed_form:
            return "closed form"
        return "native, two formulations" if self.alone else "independent codes"

    @property
    def words(self) -> str:
        """For a table: "closed form, native, exudyn (witness)"; of one code alone also its formulations."""
        if self.alone:
            return f"{self.codes[0]} alone ({', '.join(self.formulations)})"
        formulas = ["closed form"] * self.closed_form + [OWN_EQUATIONS] * self.own_equations
        marks = {witness: " (witness)" for witness in self.witnesses}
        return ", ".join(f"{code}{marks.get(code, '')}" for code in (*formulas, *self.codes))


def basis(routes: Iterable[str]) -> Basis:
    """What the routes of a stored reference consist of."""
    names, stands = [], dict[str, bool]()  # engines; whether a code or a kind of file is more than a witness
    for route in routes:
        name, _, how = route.partition(", ")
        equal = not how.endswith(f", {WITNESS}")
        formula = how.removesuffix(f", {WITNESS}")
        what = formula if formula in FORMULAS else name.partition("-")[0]
        stands[what] = stands.get(what, False) or equal
        names += [] if formula in FORMULAS else [name]
    codes = tuple(code for code in stands if code not in FORMULAS)
    witnesses = tuple(code for code, equal in stands.items() if not equal)
    exact = CLOSED_FORM in stands or MANUFACTURED in stands
    return Basis(exact, OWN_EQUATIONS in stands, codes, tuple(dict.fromkeys(names)), witnesses)


def contradiction(kind: ReferenceKind, found: Basis) -> str:
    """Why a case must not be called `kind`; "" if it may. Published numbers may be met by routes of any kind."""
    if kind == "published" or FOLLOWS.get(kind, kind) == found.kind:
        return ""
    return f'it is called "{kind}", and its routes ({found.words}) make it "{found.kind}"'


FOLLOWS: dict[ReferenceKind, ReferenceKind] = {"high precision": "native, two formulations"}
"""Another word for the same."""
