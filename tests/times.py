"""Processor time of the default suite, by file: it is short because no file takes much of it.

Clocks on the wall tell who else was busy. Processor time, of a test and of the processes that it has waited for, grows
with all of the suite on a slow or busy machine. Therefore files are judged by their share, and the whole only where the
machine was not shared.
"""

from __future__ import annotations

import os
from collections.abc import Mapping

WHOLE = 5000  # tests; below, it was not the suite that ran
LIMIT_S = 1800.0  # for all tests together, twice what they should take on the quiet cores that they are measured on
SHARE = 0.06  # of the suite, for one file
EXEMPT = "tests/repo/test_code.py"  # mypy takes a minute where it finds no cache


def processor_s() -> float:
    """Of this process and of all that it has waited for."""
    return sum(os.times()[:4])


def excesses(spent: Mapping[str, float], tests: int, shared: bool) -> list[str]:
    """What takes too long, in words: processor time (s) by file, the number of tests, whether others were at work."""
    whole = sum(spent.values())
    if tests < WHOLE:
        return []
    found = [
        f"{file} takes {seconds:.0f} s of processor time, more than {SHARE:.0%} of the suite's"
        for file, seconds in spent.items()
        if seconds > SHARE * whole and file != EXEMPT
    ]
    if whole > LIMIT_S and not shared:
        found.append(f"the suite takes {whole:.0f} s of processor time, more than {LIMIT_S:.0f} s")
    return found


def is_shared() -> bool:
    """Whether more wanted to run than the suite, over the last quarter of an hour."""
    return os.getloadavg()[2] > 1.5 * (os.cpu_count() or 1)
