"""A session of the small case with many comparisons, some of which are not as expected."""

from pathlib import Path

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.library.find import load_case
from crosscheck.report import write_all
from tests.crosscheck.sessions import copy_case, sweep_here

COMPARISON = """
[[comparison]]
name = "number {number}"
variant = "rigid"
engines = {engines}
goals = {{ marker = {goal}, load = {goal}, energy = {goal} }}
"""
MANY = """
[[variant]]
name = "rigid"
engines = ["fine", "stepper", "diverger"]

[[chart]]
observable = "marker:tip.position"
variants = ["rigid"]
reference = "rigid"

[[conservation]]
variant = "rigid"
quantity = "energy"
limit = 1e-3
engines = ["fine", "stepper"]
""" + "".join(
    COMPARISON.format(
        number=number,
        goal=1e-2 if number else 1e-12,
        engines='["fine", "stepper", "diverger"]' if number == 1 else '["fine", "stepper"]',
    )
    for number in range(12)
)


def session(folder: Path, run_file: str) -> tuple[SessionOutcome, Path]:
    """Run the small case with another run file, and write the report into the folder."""
    case = load_case(copy_case(folder, run_file))
    sweep_here([case], (), folder / "records.jsonl")
    return write_all(folder / "records.jsonl", folder)
