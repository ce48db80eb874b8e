"""Feedback: sensors, controllers and what they drive, in the same compiled loop as the motion."""
