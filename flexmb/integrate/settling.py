"""Projection to the manifold of a constrained problem without exciting stiff modes.

`project` takes the shortest way in the metric of kinetic energy, which also displaces stiff components. The change
is small, but the restoring forces are large, and the next step would have to resolve them. So the change dq, du of a
projection is relaxed under these forces for the time 1/rate, by one implicit Euler step of the linear equations
z' = J z:

    (rate - J) z = rate [dq - qdot(du) / rate; du].

What is stiff dies out, and what closes a constraint stays: J is that of constrained equations, which keep its error but
for its rate. Then little is left to project.
"""

from flexmb.integrate.control import copy
from flexmb.integrate.newton_matrix import factorise, find_blocks, solve
from flexmb.jit.kernel import helper, sweep


@sweep
def settle(problem, t, rate, y, s, accuracy):
    """Put y on its manifold at time t; s: J (n,n), factors `real` of rate - J, and `change` (n,)."""
    if problem.settles:
        n = accuracy.controlled
        copy(y, s.change)
        problem.project(t, s.change, problem.constants)
        for i in range(y.shape[0]):
            s.change[i] -= y[i]
        for i in range(accuracy.coordinates):
            for j in range(accuracy.coordinates, n):
                s.change[i] -= s.J[i, j] * s.change[j] / rate
        solve(s.real, s.J, s.change)
        for i in range(n):
            y[i] += rate * s.change[i]
    problem.project(t, y, problem.constants)


@helper
def prepare_settling(problem, rate, s):
    """Factorise rate - J, for methods that have no factors of their own."""
    if problem.settles:
        find_blocks(s.real.blocks, s.J, s.real.inner.shape[0])
        factorise(s.real, s.J, rate)
