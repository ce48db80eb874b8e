"""A compiled scene, a tree or a closed chain, and everything that can be asked of it at one state."""
