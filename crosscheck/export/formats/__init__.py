"""The rigid trees of the library in the formats of other programs, each only where it holds the mechanism exactly."""
