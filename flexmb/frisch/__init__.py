"""Frisch's nested-body equations (NASA TN D-8047, 1975): mode-dependent parameters, partitioned form, equivalences.

This implementation and the recursion share the tables of a scene, the kinematics and forces of hinges, and the modal
field. The parameters of the bodies, the partitions, the reduction, the solution and the loads are separate. Comparing
the two therefore cannot reveal a defect in a shared part; `flexmb.dense` shares no dynamics with either.

The order of an evaluation is `motion` (base to tip), `nests` (tips to base), `partitions` (the matrix of (111)),
`reduction` (to the speeds, and the solution) and `constraint` (loads across hinges).
"""
