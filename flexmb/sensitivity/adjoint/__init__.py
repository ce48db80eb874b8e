"""The discrete adjoint of a run: the gradient of one scalar by many numbers, backwards through the steps of the run."""
