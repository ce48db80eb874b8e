"""The factors of credibility of NASA-STD-7009B, and in our own words what each level of each stands for.

The standard asks for an assessment by people who know the intended use. The criteria here are what of its scale a file
can show; `docs/credibility.md` says which rules find them, and where the standard asks for more.
"""

from __future__ import annotations

from typing import Literal, get_args

Factor = Literal[
    "data_pedigree", "verification", "validation", "input_pedigree",
    "uncertainty", "robustness", "history", "management",
]  # fmt: skip
FACTORS: tuple[Factor, ...] = get_args(Factor)
HIGHEST = 4

TITLES: dict[Factor, str] = {
    "data_pedigree": "Data pedigree",
    "verification": "Verification",
    "validation": "Validation",
    "input_pedigree": "Input pedigree",
    "uncertainty": "Uncertainty characterization",
    "robustness": "Results robustness",
    "history": "M&S history",
    "management": "M&S process and product management",
}
CRITERIA: dict[Factor, tuple[str, str, str, str, str]] = {
    "data_pedigree": (
        "nothing on file",
        "the sources of the data on which the model was built are named",
        "these data are numbers with a source and an uncertainty of their own",
        "they are measured, with instrument and uncertainty as the source states them",
        "they are measured on the very system of the intended use",
    ),
    "verification": (
        "nothing on file",
        "one code reproduces itself in two formulations, or under refinement",
        "independent codes, or one and a closed form, agree in what the case is about",
        "with a numerical error that is estimated for every agreement, and planted faults that are noticed",
        "with errors below their goals in everything that is offered, and nothing worse than before",
    ),
    "validation": (
        "nothing on file",
        "the model meets published numbers with their uncertainty",
        "it is held against measurements with a budget for every point, and its error is known",
        "every series of these measurements is within its validation uncertainty",
        "the same by measurements on the very system of the intended use",
    ),
    "input_pedigree": (
        "nothing on file",
        "sources of the inputs are named",
        "every input has a width, stated by the source or declared with a reason",
        "every input has the width that the source states",
        "every input was measured on the very system of the intended use",
    ),
    "uncertainty": (
        "nothing on file",
        "the numerical uncertainty of the results is estimated",
        "beside it the spread of the results by the printed digits of all inputs",
        "the uncertainties of numbers, inputs and readings are combined for every point",
        "the same, and confirmed by samples of all inputs",
    ),
    "robustness": (
        "nothing on file",
        "changes of single inputs are seen to change the results",
        "the spread of all results is known where all inputs move together",
        "the change of every result by every input is known",
        "and which of them matter in the intended use has been decided",
    ),
    "history": (
        "nothing on file",
        "results of an earlier version are stored",
        "the present code reproduces them, within their stated uncertainty",
        "predictions were later confirmed by measurements",
        "it is the accepted tool for the intended use",
    ),
    "management": (
        "nothing on file",
        "scene and results belong together by digests",
        "a session is sealed, with the digests of all files and the versions of all codes",
        "that session kept the strict rules: nothing unjudged, unrecorded or worse than recorded",
        "the process is itself measured and improved",
    ),
}
