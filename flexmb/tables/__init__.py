"""What kernels work on: the arrays of a scene and of an evaluation, its state, and the gate that arguments pass."""
