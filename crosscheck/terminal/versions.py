"""The text of `--version`: this package, Python, the compiler, and the installed engines."""

from __future__ import annotations

import platform

from crosscheck.running.installed import describe_engines
from flexmb.output.versions import version_of


def versions_text() -> str:
    """One line for each version, for bug reports; all engines are asked, including plug-ins."""
    lines = [f"crosscheck {version_of('flexmb')}", f"Python {platform.python_version()}, numba {version_of('numba')}"]
    engines: dict[str, list[str]] = {}
    for each in describe_engines():
        engines.setdefault(each.version or each.absence, []).append(each.name)
    lines += [f"{', '.join(names)}: {text}" for text, names in engines.items()]
    return "\n".join(lines)
