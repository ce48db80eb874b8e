"""Dynamics of trees of rigid and flexible bodies by Jain & Rodriguez (1992): recursions, and dense operators to check.

`sweeps` is the forward dynamics by articulated bodies, O(N); `inverse` the inverse dynamics, O(N); `composite` the mass
matrix by composite bodies and the forward dynamics that factorises it; `innovations` the factors of M by recursion,
with solutions and products; `unsplit` the forward dynamics that eliminates the modes and the hinge of a body in one
step; `operators` the equations as printed, dense, to be read and tested against. (63) eliminates the modes of a body
first, by D_f, then its hinge, by D_R. Which variant of an elimination runs is decided as follows.

The modes of a body:

    explicit    L D L' of D_f. The default; the only variant where `flexmb.jain.elimination.applies` is False
    condensed   With `elimination="fastest"` where it applies and the body has the number of modes from which it was
                measured to be faster (`flexmb.jain.elimination.is_faster`); with "condensed" wherever it applies
    woodbury    With `elimination="woodbury"` only, wherever it applies: condensing is faster with many modes, the
                factorisation with few (docs/costs.md)

How `explicit` orders its operations (`flexmb.jit.kernel.by_width`, by the types of the arguments):

    right-looking   one scene in double precision: long rows without mutual dependence fill vector registers
    left-looking    lanes (eight copies of a scene at once) and duals (seven derivatives at once): every number is a
                    vector already, and each row is stored once only

The hinge of a body (`flexmb.jain.hinge_solve.eliminate`):

    single axis   one free speed, rotation about z or translation along z, O being the origin of the body frame: D_R is
                  a number
    general       none or several speeds, prescribed speeds, or O on a node that deforms: Cholesky factor of D_R

Other choices:

    unsplit       `algorithm="unsplit"` only: (51), (58) with one factor for modes and hinge, to check the split form
    composite     `algorithm="composite"`: (46), whose cost grows with the cube of the number of speeds
    pivoting      the root of Omega, `flexmb.jain.condensed.semidefinite_root`: without pivoting where the matrix is
                  positive definite to round-off, with complete pivoting otherwise
"""
