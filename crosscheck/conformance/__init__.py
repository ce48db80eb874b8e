"""Tests of an engine against the contract: each clause is a sentence, tried on small scenes with known answers."""
