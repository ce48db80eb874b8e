"""Which processors a kernel runs on: the one it was compiled for, or any that can do as much.

What is compiled here is for this very processor. Kernels of a wheel that others install are for a level of x86-64
instead, as the psABI of System V defines them: v3 has AVX2 and fused multiplication, v4 has AVX-512 too.
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
"""What a processor has to have beside what the next lower level has; the highest first."""


def compiled_for(codegen: Any) -> tuple[str, ...]:
    """Platform, processor and its features that kernels are now compiled for: part of their keys."""
    return tuple(codegen.magic_tuple())


def running(codegen: Any) -> list[tuple[str, ...]]:
    """Of what kernels can have been compiled for that run here: this processor first, then the levels that it has.

    Who names a processor to numba gets kernels for that one.
    """
    own = compiled_for(codegen)
    if config.CPU_NAME is not None:
        return [own]
    return [own, *((own[0], level, "") for level in _levels() if own[1] != level)]


@cache
def _levels() -> tuple[str, ...]:
    """Levels of this processor, the highest first."""
    if not binding.get_process_triple().startswith("x86_64"):
        return ()
    features = binding.get_host_cpu_features()
    names = list(LEVELS)
    return tuple(
        name
        for i, name in enumerate(names)
        if all(features.get(each, False) for lower in names[i:] for each in LEVELS[lower])
    )
