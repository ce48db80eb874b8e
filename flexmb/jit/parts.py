"""Compilation of helpers: into what calls them only.

Numba optimises every function it compiles together with all that it calls, and makes machine code of both, at every
level of the calls: for helpers, which nobody calls from outside, that is lost. Here they are kept as they were lowered;
what is left of the work is done once, in the kernel that they become part of. The right-hand side of a tree with all
hinges and levels is compiled in 20 s of processor time instead of 36 s, and runs as fast.
"""

from __future__ import annotations

from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import InlineOverloads, NativeLowering, NopythonRewrites
from numba.core.untyped_passes import InlineClosureLikes, RewriteSemanticConstants

from flexmb.jit.features import KnownFeatures

_FOR_ARRAYS_AND_CLOSURES = {InlineClosureLikes, InlineOverloads, NopythonRewrites}  # helpers have none to improve


class _NoMachineCode:
    """A code generator without places for environments: Python objects that no helper uses."""

    def set_env(self, name: str, environment: Any) -> None:
        """Nothing to set: there is no machine code yet."""


class _PartLibrary(JITCodeLibrary):
    """A function as it was lowered, for linking."""

    codegen = _NoMachineCode()

    def _optimize_final_module(self) -> None:
        """Left to the kernel."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):
    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        return bool(super().run_pass(state))


class KernelCompiler(Compiler):
    """The default compiler, which knows the features of bundles before it infers types."""

    def define_pipelines(self) -> list[Any]:
        """The default passes and one more."""
        [manager] = super().define_pipelines()
        manager.add_pass_after(KnownFeatures, RewriteSemanticConstants)
        manager.finalize()
        return [manager]


class PartCompiler(KernelCompiler):
    """The same up to the lowering, which leaves a part."""

    def define_pipelines(self) -> list[Any]:
        """The passes of a kernel, with the last but one exchanged."""
        [manager] = super().define_pipelines()
        manager.passes = [
            (_PartLowering, text) if which is NativeLowering else (which, text)
            for which, text in manager.passes
            if which not in _FOR_ARRAYS_AND_CLOSURES
        ]
        manager._finalized = False
        manager.finalize()
        return [manager]
