"""Back to the manifold of a constrained problem without setting what is stiff in motion.

`project` takes the shortest way by kinetic energy, which displaces what is stiff as well as what is not. Small as this
is, forces that move it back are large, and a step after it has to resolve them. Where the projection changes y by dq,
du, those stiff forces are let act on the change for a while 1/rate, by the implicit rule of Euler for the linear
equations z' = J z:

    (rate - J) z = rate [dq - qdot(du) / rate; du].

What is stiff dies out, and what closes a constraint stays: J is that of constrained equations, which keep its error but
for its rate. Then little is left to project.
"""

from flexmb.integrate.control import copy
from flexmb.integrate.lu import lu_factorise, lu_solve
from flexmb.jit.kernel import helper, sweep


@sweep
def settle(problem, t, rate, y, s, accuracy):
    """Put y on its manifold at time t; s: J (n,n), factors `real` and `real_pivots` of rate - J, and `change` (n,)."""
    if problem.settles:
        n = accuracy.controlled
        copy(y, s.change)
        problem.project(t, s.change, problem.constants)
        for i in range(y.shape[0]):
            s.change[i] -= y[i]
        for i in range(accuracy.coordinates):
            for j in range(accuracy.coordinates, n):
                s.change[i] -= s.J[i, j] * s.change[j] / rate
        lu_solve(s.real, s.real_pivots, s.change)
        for i in range(n):
            y[i] += rate * s.change[i]
    problem.project(t, y, problem.constants)


@helper
def prepare_settling(problem, rate, s):
    """The factors, for methods that have none."""
    if problem.settles:
        for i in range(s.J.shape[0]):
            for j in range(s.J.shape[0]):
                s.real[i, j] = -s.J[i, j]
            s.real[i, i] += rate
        lu_factorise(s.real, s.real_pivots)
