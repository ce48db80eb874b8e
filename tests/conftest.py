"""Kernels of the suite are general ones: a thousand scenes, each for a moment, would each ask for kernels of its own.

That kernels of a scene's own features compute the same is for tests/flexmb/tables/test_features.py to show.
"""

import os

os.environ.setdefault("FLEXMB_KERNELS", "general")
