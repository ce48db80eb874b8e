"""The time limit of a clause, in a file that the command line can import without the clauses."""

from __future__ import annotations

CLAUSE_LIMIT_S = 180.0  # an engine may have to compile at its first clause
