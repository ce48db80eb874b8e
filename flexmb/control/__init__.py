"""Feedback control: sensors, controllers and actuated loads, in the same compiled loop as the motion."""
