"""The data of kernels: arrays of a scene and of an evaluation, states, status codes, and checks of arguments."""
