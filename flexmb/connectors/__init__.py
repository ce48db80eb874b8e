"""What connectors exert, from the motion of what they join: laws of loads, lines, bushings, springs and friction."""
