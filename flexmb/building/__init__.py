"""From a scene to the tables: bodies and hinges in the frames of the dynamics, numbered, with their inertia."""
