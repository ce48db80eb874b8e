"""An engine that is there and cannot be used."""


class Unusable(RuntimeError):
    """The message names what cannot be used, says why, and what to do; a session that asks for it ends with that."""
