"""The output of `flexmb --version`."""

from __future__ import annotations

import platform

from flexmb.output.versions import version_of


def versions_text() -> str:
    """Versions of this package, Python, and the libraries on which results and speed depend."""
    lines = [f"flexmb {version_of('flexmb')}", f"Python {platform.python_version()}"]
    return "\n".join([*lines, *(f"{name} {version_of(name)}" for name in ("numba", "numpy", "scipy"))])
