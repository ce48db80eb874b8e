"""Frisch's nested-body equations (NASA TN D-8047, 1975): mode-dependent parameters, partitioned form, equivalences.

This route shares with the recursion the tables of a scene, the kinematics and forces of its hinges, and the field of
modes. Its own are the parameters of the bodies, the partitions, the reduction, the solution and the loads. A defect in
a shared part is therefore the same in both; only `flexmb.dense` shares no dynamics with either.
"""
