"""What is wrong with an FMU or its mapping, by name."""

from crosscheck.engines.unusable import Unusable


class BadFmu(Unusable):
    """An FMU that cannot be used as an engine; the message names the file, the fault and the remedy."""
