"""What general kernels cost to compile, without a clock: bytes of the machine code of each, which seconds go with.

    python -m tests.flexmb.jit.code_budget    # write tests/flexmb/jit/code_budget.json anew

All that an installation brings along is measured. How many bytes a kernel takes is a matter of the processor, so that
there is a baseline for each that was measured; which kernels there are, and in how many versions, is the same on all.
"""

from __future__ import annotations

import json
import pickle
import zlib
from collections import defaultdict
from pathlib import Path
from typing import Any

import msgspec

BASELINE = Path(__file__).with_name("code_budget.json")
SLACK, SMALL = 1.03, 512  # what an edit may add by the way: a share, and bytes
_DIGEST = 32


class Codes(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Bytes of the versions of each kernel, the smallest first; `made` is what they were compiled by and for."""

    made: dict[str, Any]
    kernels: dict[str, list[int]]


def measured(folder: Path) -> Codes:
    """Of the kernels in the folder of an installation."""
    from flexmb.jit.installed import MADE_BY

    made = json.loads((folder / MADE_BY).read_text(encoding="utf-8"))
    found = defaultdict[str, list[int]](list)
    for file in folder.glob("*.kernel"):
        _, _, (library, fndesc, *_) = pickle.loads(zlib.decompress(file.read_bytes()[_DIGEST:]))
        _, _, (machine_code, _) = library
        found[f"{fndesc.modname}.{fndesc.qualname}"].append(len(machine_code))
    return Codes(
        {"versions": made["versions"], "processor": made["processor"][1]},
        {name: sorted(sizes) for name, sizes in sorted(found.items())},
    )


def added(now: Codes, before: Codes) -> list[str]:
    """Which kernels there were not, or are compiled more often, as sentences."""
    return [
        f"{name}: {len(sizes)} versions instead of {len(before.kernels.get(name, []))}"
        for name, sizes in now.kernels.items()
        if len(sizes) > len(before.kernels.get(name, []))
    ]


def grown(now: Codes, before: Codes) -> list[str]:
    """Which kernels have more code, as sentences."""
    return [
        f"{name}: {size} bytes instead of {most}"
        for name, sizes in now.kernels.items()
        for size, most in zip(reversed(sizes), reversed(before.kernels.get(name, [])), strict=False)  # largest first
        if size > SLACK * most + SMALL
    ]


def baselines() -> list[Codes]:
    """What is stored, for each processor that was measured, the last one first."""
    return msgspec.json.decode(BASELINE.read_bytes(), type=list[Codes])


def renewed(now: Codes, before: list[Codes]) -> list[Codes]:
    """With new ones for this processor. Those for others stay where it has the same code as before, or had none: else
    they are of other code."""
    same = [codes.kernels == now.kernels for codes in before if codes.made == now.made]
    others = [codes for codes in before if codes.made != now.made and not (added(now, codes) or added(codes, now))]
    return [now, *(others if all(same) else [])]


def main() -> None:
    """Write what this installation has."""
    from flexmb.jit.installed import installed_directory, unfit

    folder = installed_directory()
    if folder is None or unfit():
        raise SystemExit(f"no kernels of this code: {unfit()}; python -m flexmb.ready.make flexmb/ready/kernels")
    found = renewed(measured(folder), baselines())
    BASELINE.write_bytes(msgspec.json.format(msgspec.json.encode(found), indent=1) + b"\n")


if __name__ == "__main__":
    main()
