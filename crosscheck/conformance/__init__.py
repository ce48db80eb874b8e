"""Whether an engine keeps the contract: one clause a sentence of it, tried on small scenes with known answers."""
