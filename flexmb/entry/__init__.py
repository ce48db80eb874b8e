"""Entry points: the kernels that Python and the integrators call, one file for each purpose."""
