"""Kernels of the suite are general ones: a thousand scenes, each for a moment, would each ask for kernels of its own.

That kernels of a scene's own features compute the same is for tests/flexmb/tables/test_features.py to show.
"""

import gc
import os

import pytest

os.environ.setdefault("FLEXMB_KERNELS", "general")


def pytest_configure(config: pytest.Config) -> None:
    """A kernel that cannot be kept fails the test that compiles it: every process would compile it anew."""
    config.addinivalue_line("filterwarnings", "error:.* holds addresses of this process:RuntimeWarning")


def pytest_collection_finish() -> None:
    """The collector passes over what is there from now on: a million objects of numba's, and thousands of tests."""
    gc.collect()
    gc.freeze()
