"""Frisch's nested-body equations (NASA TN D-8047, 1975): mode-dependent parameters, partitioned form, equivalences."""
