"""The equations of motion rebuilt from the exported data by NumPy and integrated by SciPy: eight pieces of level stiffened.

They have the points, modes and field of second order of `model.json` and `modal/*.json`, and nothing of flexmb's dynamics.
"""

from crosscheck.export.equations import rebuilt

exact = rebuilt(__file__, rtol=1e-9)
