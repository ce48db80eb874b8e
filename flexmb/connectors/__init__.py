"""Loads of connectors from the motion of the frames that they join: load laws, lines, bushings, springs, friction."""
