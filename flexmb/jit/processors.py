"""The processors that a kernel runs on: the one it was compiled for, or all that have its instructions.

Kernels that are compiled here are for this processor. Kernels of a wheel for other machines are for a level of x86-64
instead, as defined by the System V psABI: v3 has AVX2 and fused multiply-add, v4 has AVX-512 too.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from llvmlite import binding
from numba import config

LEVELS = {
    "x86-64-v4": ("avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"),
    "x86-64-v3": ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"),
}
"""The features that a level requires in addition to those of the next lower level; the highest level first."""


def compiled_for(codegen: Any) -> tuple[str, ...]:
    """The platform, the processor and its features for which kernels are compiled now; part of their keys."""
    return tuple(codegen.magic_tuple())


def running(codegen: Any) -> list[tuple[str, ...]]:
    """The processors whose kernels run here: this processor first, then the levels that it has.

    If numba is configured for a certain processor, that one only.
    """
    own = compiled_for(codegen)
    if config.CPU_NAME is not None:
        return [own]
    return [own, *((own[0], level, "") for level in _levels() if own[1] != level)]


@cache
def _levels() -> tuple[str, ...]:
    """The levels of x86-64 that this processor has, the highest first."""
    if not binding.get_process_triple().startswith("x86_64"):
        return ()
    features = binding.get_host_cpu_features()
    names = list(LEVELS)
    return tuple(
        name
        for i, name in enumerate(names)
        if all(features.get(each, False) for lower in names[i:] for each in LEVELS[lower])
    )
