"""What `flexmb --version` says."""

from __future__ import annotations

import platform

from flexmb.output.versions import version_of


def versions_text() -> str:
    """This package, Python, and the libraries that decide what comes out and how fast."""
    lines = [f"flexmb {version_of('flexmb')}", f"Python {platform.python_version()}"]
    return "\n".join([*lines, *(f"{name} {version_of(name)}" for name in ("numba", "numpy", "scipy"))])
