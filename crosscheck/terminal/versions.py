"""What `--version` says: this package, Python, the compiler, and the engines that are installed."""

from __future__ import annotations

import platform

from crosscheck.running.installed import describe_engines
from flexmb.output.versions import version_of


def versions_text() -> str:
    """One line a fact, as a report of a defect needs them. Engines are asked themselves, plug-ins among them."""
    lines = [f"crosscheck {version_of('flexmb')}", f"Python {platform.python_version()}, numba {version_of('numba')}"]
    engines: dict[str, list[str]] = {}
    for each in describe_engines():
        engines.setdefault(each.version or each.absence, []).append(each.name)
    lines += [f"{', '.join(names)}: {text}" for text, names in engines.items()]
    return "\n".join(lines)
