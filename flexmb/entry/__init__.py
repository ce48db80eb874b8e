"""Entry points: kernels that Python and the integrators call, one file for each thing that is asked for."""
