"""Compilation of helpers into their callers only.

Numba optimises every function together with all functions that it calls, and generates machine code for both, at every
level of the calls. For helpers, which are called from kernels only, this work is wasted. Here the unoptimised LLVM code
of helpers is kept, and optimised once in the kernel that it becomes part of. The right-hand side of a tree with all
hinges and levels then compiles in 20 s of processor time instead of 36 s, and runs as fast.

Helpers are inlined whatever their size. This makes special kernels nearly twice as fast and general ones faster by a
third, and takes a sixth more time to compile.

A kernel that calls another kernel contains a symbol for it, and none of its code (linking.py).
"""

from __future__ import annotations

from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import InlineOverloads, NativeLowering, NopythonRewrites
from numba.core.untyped_passes import InlineClosureLikes, RewriteSemanticConstants

from flexmb.jit.features import KnownFeatures
from flexmb.jit.linking import Callee, refer


class _NoMachineCode:
    """A code generator that does not store environments, Python objects that helpers do not use."""

    def set_env(self, name: str, environment: Any) -> None:
        """Does nothing, because there is no machine code."""


class _PartLibrary(JITCodeLibrary):
    """The unoptimised LLVM code of a helper, for linking."""

    codegen = _NoMachineCode()

    def finalize(self) -> None:
        """Linking, optimisation and verification are left to the kernel."""
        self._raise_if_finalized()
        self._finalized = True

    def alone(self) -> Any:
        """Its module, without the functions that it calls."""
        return super()._get_module_for_linking()

    def _get_module_for_linking(self) -> Any:
        """Its module with the functions that it calls, for a caller that is not compiled by this module."""
        whole = self.alone().clone()
        for called in _callers_first(self):
            linked = called.alone() if isinstance(called, _PartLibrary) else called._get_module_for_linking()
            whole.link_in(linked, preserve=True)
        return whole


class KernelLibrary(JITCodeLibrary):
    """A kernel, into which each of its helpers is linked once, whatever the number of calls; `callees` are kernels."""

    callees: tuple[Callee, ...] = ()
    held: tuple[Any, ...] = ()

    def finalize(self) -> None:
        """Link all helpers that it calls, directly or indirectly, and refer to kernels by symbols."""
        called = _callers_first(self)
        for part in called:
            if isinstance(part, _PartLibrary):
                self._final_module.link_in(part.alone(), preserve=True)
        others = [library for library in called if not isinstance(library, _PartLibrary)]
        referred = {library: refer(self._final_module, library) for library in others}
        self.callees = tuple(callee for callee in referred.values() if callee is not None)
        self.held = tuple(library for library, callee in referred.items() if callee is not None)
        self._linking_libraries = [library for library, callee in referred.items() if callee is None]
        super().finalize()


def _callers_first(library: JITCodeLibrary) -> list[JITCodeLibrary]:
    """Libraries that it calls, directly or through helpers, each after its callers: the linker drops unused code."""
    met, found = set[JITCodeLibrary](), list[JITCodeLibrary]()

    def visit(calling: JITCodeLibrary) -> None:
        for called in calling._linking_libraries:
            if called not in met:
                met.add(called)
                if isinstance(called, _PartLibrary):
                    visit(called)
                found.append(called)

    visit(library)
    return found[::-1]


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):
    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        return bool(super().run_pass(state))


@register_pass(mutates_CFG=True, analysis_only=False)
class _KernelLowering(NativeLowering):
    _name = "kernel_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = KernelLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return bool(super().run_pass(state))


class KernelCompiler(Compiler):
    """Numba's compiler, with features of bundles known before type inference, and a `KernelLibrary` for linking."""

    _lowering: type[NativeLowering] = _KernelLowering
    _left_out: frozenset[type] = frozenset()

    def define_pipelines(self) -> list[Any]:
        """The default passes with `KnownFeatures` added, the lowering replaced, and those of `_left_out` removed."""
        [manager] = super().define_pipelines()
        manager.add_pass_after(KnownFeatures, RewriteSemanticConstants)
        manager.passes = [
            (self._lowering if which is NativeLowering else which, text)
            for which, text in manager.passes
            if which not in self._left_out
        ]
        manager._finalized = False
        manager.finalize()
        return [manager]


class PartCompiler(KernelCompiler):
    """The same for helpers, whose lowering makes a `_PartLibrary`."""

    _lowering = _PartLowering
    _left_out = frozenset({InlineClosureLikes, InlineOverloads, NopythonRewrites})  # helpers have no such code
