"""The equations of motion rebuilt from the exported data by NumPy, integrated by SciPy: a panel on a hub.

They have the points, modes and second-order field of `model.json` and `modal/*.json`, and nothing of flexmb's dynamics.
"""

from crosscheck.export.model import rebuilt

exact = rebuilt(__file__, rtol=1e-9)
