"""How long a clause may take: in a file of its own, from which the command line takes it without the clauses."""

from __future__ import annotations

CLAUSE_LIMIT_S = 180.0  # an engine may have to compile at its first clause
