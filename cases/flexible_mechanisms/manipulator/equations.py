"""The equations of motion rebuilt from the exported data by NumPy, integrated by SciPy.

They have the points and modes of `model.json` and `modal/*.json`, and nothing of flexmb's dynamics.
"""

from crosscheck.export.model import rebuilt

exact = rebuilt(__file__, rtol=1e-9)
