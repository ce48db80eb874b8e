"""Compilation of helpers: into what calls them only.

Numba optimises every function it compiles together with all that it calls, and makes machine code of both, at every
level of the calls: for helpers, which nobody calls from outside, that is lost. Here they are kept as they were lowered;
what is left of the work is done once, in the kernel that they become part of. The right-hand side of a tree with all
hinges and levels is compiled in 20 s of processor time instead of 36 s, and runs as fast.

Helpers are written out where they are called, whatever their size: that makes a kernel for one kind of scene nearly
twice as fast, and a general one by a third, for a sixth more of compiling.

A kernel that calls another kernel has a symbol in its place and nothing of its code (linking.py).
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
    """A code generator without places for environments: Python objects that no helper uses."""

    def set_env(self, name: str, environment: Any) -> None:
        """Nothing to set: there is no machine code yet."""


class _PartLibrary(JITCodeLibrary):
    """A function as it was lowered, for linking."""

    codegen = _NoMachineCode()

    def finalize(self) -> None:
        """Linking what it calls, optimising and verifying are left to the kernel."""
        self._raise_if_finalized()
        self._finalized = True

    def alone(self) -> Any:
        """Its module, without what it calls."""
        return super()._get_module_for_linking()

    def _get_module_for_linking(self) -> Any:
        """With all that it calls, for a caller that is not compiled by this file."""
        whole = self.alone().clone()
        for called in _callers_first(self):
            linked = called.alone() if isinstance(called, _PartLibrary) else called._get_module_for_linking()
            whole.link_in(linked, preserve=True)
        return whole


class KernelLibrary(JITCodeLibrary):
    """A kernel, into which every part of it is linked once, however many others call it; `callees` are kernels."""

    callees: tuple[Callee, ...] = ()
    held: tuple[Any, ...] = ()

    def finalize(self) -> None:
        """With all that it calls, directly or not."""
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
    """What it calls, directly or through parts, each after all its callers: a linker takes only what is asked for."""
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
    """The default compiler, which knows the features of bundles before it infers types, and links parts by itself."""

    _lowering: type[NativeLowering] = _KernelLowering
    _left_out: frozenset[type] = frozenset()

    def define_pipelines(self) -> list[Any]:
        """The default passes and one more, with the last but one exchanged."""
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
    """The same for helpers: up to the lowering, which leaves a part."""

    _lowering = _PartLowering
    _left_out = frozenset({InlineClosureLikes, InlineOverloads, NopythonRewrites})  # helpers have none to improve
