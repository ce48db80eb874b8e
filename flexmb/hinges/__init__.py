"""Hinges: one file per kind, which declares all of it as `HINGE` (see `flexmb.hinges.kind`), with five kernels.

``pose(q, i, sequence, parameters)``
    Relative pose of the outboard frame O in the inboard frame O+: R (9) maps O components to O+ components, p (3) is
    O's origin in O+ axes.
``motion(q, i, u, j, sequence, parameters, H)``
    Fills the hinge map H (6 x n, outboard axes, velocity at O's origin; the transpose of Jain's) and returns the pairs
    V = (w, v) and A = (alpha, a): relative velocity V = H u and the relative acceleration left when udot = 0, as seen
    from O+, in O axes. The linear part belongs to O's origin.
``rate(q, i, u, j, dq)``
    Configuration rate qdot(q, u), written to dq[i:i+nq].
``retract(q, i, increment, j, result)``
    The coordinates at the end of a unit of time at the constant speeds `increment`, written to result[i:i+nq]: of
    kinds with a quaternion. Where coordinates are scalars, the increments are added to them. The increment of a
    position is in O+ axes.
``resolve(q, i, u, x, j, how)``
    Resolves x[j:j+n] between the axes of u and those of increments, in place, where these differ: see `resolve` of
    `flexmb.motion.retraction`.

q, u and increment are the whole vectors; the hinge's coordinates begin at q[i], its speeds at u[j]. `sequence` (3,)
holds the axis numbers of a gimbal, `parameters` (3,) real numbers of the hinge, such as the pitch of a screw. Axes of
one-axis kinds are z: `reduced` turns the hinge frames so at build time.

A new kind is a struct in `flexmb.scene.hinges`, a file here, and its name in the list of `flexmb.hinges.catalogue`.
"""
