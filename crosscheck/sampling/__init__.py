"""Monte Carlo, Latin hypercubes and grids over the parameters of a scene: `crosscheck sweep FILE`."""
