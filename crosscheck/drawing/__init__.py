"""What a report draws of a scene: lines that its markers carry, and the run from which its animation is made."""
