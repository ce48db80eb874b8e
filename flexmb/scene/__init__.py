"""Scenes: what a multibody system consists of, read, checked and written, without physics and without a compiler."""
