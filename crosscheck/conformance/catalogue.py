"""All clauses of the contract, by name."""

from __future__ import annotations

from crosscheck.conformance.clause import Clause
from crosscheck.conformance.connectors import CONNECTORS
from crosscheck.conformance.conventions import CONVENTIONS
from crosscheck.conformance.form import FORM
from crosscheck.conformance.motion import MOTION
from crosscheck.conformance.wheels import WHEELS

CLAUSES: dict[str, Clause] = {
    clause.name: clause for chapter in (FORM, CONVENTIONS, MOTION, WHEELS, CONNECTORS) for clause in chapter.clauses
}
