"""Labels on the terminal: all factors of one subject, or the levels of many."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexmb.output.listing import Listing, figures, names, prose

if TYPE_CHECKING:
    from crosscheck.label.document import LabelFile, SubjectLabel


def levels_table(labels: LabelFile) -> Listing:
    """A row for each subject."""
    from crosscheck.label.document import level_rows
    from crosscheck.label.factors import FACTORS

    heads = (factor.replace("_", " ") for factor in FACTORS)
    table = Listing(*names("case"), *figures(*heads), title=f"Credibility by {labels.standard}, levels 0 to 4")
    for row in level_rows(labels.subjects):
        table.add(*row)
    return table


def label_table(name: str, label: SubjectLabel, everything: bool) -> Listing:
    """A row for each factor, with the evidence that counts, or all that was looked at."""
    from crosscheck.label.factors import TITLES

    use = [f"Intended use: {label.intended_use}", *(f"Limit: {each}" for each in label.limits)]
    table = Listing(
        *names("factor"), *figures("level"), *prose("what the files show", "files", "raised by"),
        title=f"{name}: {label.title}", caption=". ".join([*use, *(f"Waiver: {each}" for each in label.waivers)]),
    )  # fmt: skip
    for factor, row in label.factors.items():
        shown = [each.words for each in row.evidence if everything or each.state != "absent"]
        table.add(TITLES[factor], str(row.level), row.because, "; ".join(shown), row.raised_by)
    return table
