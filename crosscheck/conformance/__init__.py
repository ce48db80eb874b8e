"""Tests of an engine against the contract: each clause is a sentence, tried on small scenes with known answers."""

from __future__ import annotations

CLAUSE_LIMIT_S = 180.0  # an engine may have to compile at its first clause
