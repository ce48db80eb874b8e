"""What is wrong with a case: in a file of its own, which a command line reads before it reads any case."""

from __future__ import annotations


class CaseError(ValueError):
    """A case folder that cannot be run: the message names the file, the place in it and the remedy."""
