"""All clauses of the contract, by name."""

from __future__ import annotations

from crosscheck.conformance.clause import Clause
from crosscheck.conformance.connectors import CONNECTORS
from crosscheck.conformance.conventions import CONVENTIONS
from crosscheck.conformance.form import FORM
from crosscheck.conformance.linearised import LINEARISED
from crosscheck.conformance.motion import MOTION, WHEELS
from crosscheck.conformance.samples import SAMPLES
from crosscheck.conformance.trees import TREES

CHAPTERS = (FORM, CONVENTIONS, MOTION, SAMPLES, TREES, WHEELS, CONNECTORS, LINEARISED)
CLAUSES: dict[str, Clause] = {clause.name: clause for chapter in CHAPTERS for clause in chapter.clauses}
SHOWN = ("a-pendulum-swings", "a-thrown-body-flies")
"""Runs that are known in closed form, of which an engine that is to be believed in anything can make one."""
