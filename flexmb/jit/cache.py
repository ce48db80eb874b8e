"""Compiled kernels on disk: a file for each kernel and the types it was compiled for, used only if it is intact.

Numba's own cache does not check its files: a truncated file ends in a traceback, and one with a flipped bit is run. If
two processes compile a kernel at the same time for different types, its index gives both the same file. Here the name
of a file is a digest of everything that its contents depend on, files are written atomically, and each begins with the
digest of its contents. A file that does not match is deleted and compiled anew, with one warning.

Two folders are searched: the user's, which receives what is compiled here, and that of the installation, with kernels
that were compiled when flexmb was installed (`flexmb.ready`) and which is never written to.

A pendulum's first accelerations, with all imports, take 1 s of processor time if its kernel is found, and 20 s if it is
compiled.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import uuid
from collections.abc import Callable, Iterator
from contextlib import nullcontext, suppress
from functools import cached_property
from pathlib import Path
from types import FunctionType
from typing import Any

from numba.core.caching import NullCache
from numba.core.compiler_lock import global_compiler_lock
from numba.core.runtime.nrt import rtsys
from numba.core.sigutils import normalize_signature

from flexmb.jit.fingerprint import fingerprint
from flexmb.jit.folder import delete_unused, mark_used, warn_once
from flexmb.jit.installed import installed_directory
from flexmb.jit.linking import offer
from flexmb.jit.once import compiled_once
from flexmb.jit.processors import compiled_for, running
from flexmb.jit.progress import announced
from flexmb.jit.stored import packed, unpacked
from flexmb.scene.garbage import collector_paused

_DIGEST = hashlib.sha256().digest_size


class KernelCache(NullCache):
    """The cache of one function for numba's dispatcher; `folder`: where versions are kept, None to keep none."""

    def __init__(self, function: FunctionType, folder: Path | None) -> None:
        self._folder, self._function = folder, function

    @cached_property
    def _fingerprint(self) -> str:
        """At the first access, because names that a module refers to may be undefined while it is imported."""
        return fingerprint(self._function)

    @property
    def cache_path(self) -> str:
        """The folder."""
        return str(self._folder)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The version for a signature, or None where there is none that is sound."""
        rtsys.initialize(target_context)  # no more: numba's registries, which only its compiler needs, take 0.4 s
        for file in self._places(sig, target_context.codegen()):
            contents = self._contents(file)
            compiled = None if contents is None else unpacked(target_context, contents)
            if compiled is not None:
                offer(compiled, self._function, self._key(sig))
                return compiled
        return None

    def _contents(self, file: Path) -> memoryview | None:
        """The contents of a file after the digest; None if it is missing or damaged."""
        try:
            data = file.read_bytes()
        except FileNotFoundError:
            return None
        except OSError:  # a folder in its place, or no permission
            data = b""
        contents = memoryview(data)[_DIGEST:]
        if _digest(file, contents) != data[:_DIGEST]:
            self._discard(file)
            return None
        mark_used(file)
        return contents

    def filling(self, kernel: Any) -> Callable[[Any], Any]:
        """The replacement of `kernel.compile`: a version that is not on disk is compiled by one process only, with a
        message if it takes long.

        Numba's lock is taken before that of a file, so that two threads cannot wait for each other.
        """
        plain = kernel.compile

        def compile_once(signature: Any) -> Any:
            if tuple(normalize_signature(signature)[0]) in kernel.overloads:
                return plain(signature)
            codegen = kernel.targetctx.codegen()
            if any(file.is_file() for file in self._places(signature, codegen)):
                return plain(signature)
            own = nullcontext() if self._folder is None else compiled_once(self._own(self._folder, signature, codegen))
            with global_compiler_lock, announced(self._function, self._folder), own, collector_paused():
                return plain(signature)

        return compile_once

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a version; a warning if that is impossible."""
        offer(data, self._function, self._key(sig))
        if self._folder is None:
            return
        if data.library.has_dynamic_globals:
            name = f"{self._function.__module__}.{self._function.__qualname__}"
            warn_once(
                f"{name} holds addresses of this process, so it cannot be kept, and every process compiles it again: "
                "results are right; this is a defect of flexmb's own, please report it (see `handed_on` in "
                "flexmb/jit/kernel.py)"
            )
            return
        file, contents = self._own(self._folder, sig, data.codegen), packed(data)
        written = file.with_name(f"{file.name}.{uuid.uuid4().hex[:16]}")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            written.write_bytes(_digest(file, contents) + contents)
            os.replace(written, file)
            delete_unused(self._folder)
        except OSError as problem:
            if not file.is_file():  # else another process was faster
                warn_once(
                    f"compiled kernels cannot be kept in {self._folder} ({problem.strerror}), and the next "
                    "process compiles them again: make room or permit writing there, or set NUMBA_CACHE_DIR"
                )
        finally:
            with suppress(OSError):
                written.unlink()

    def _places(self, sig: Any, codegen: Any) -> Iterator[Path]:
        """The possible files of the version for a signature, the user's own first."""
        if self._folder is not None:
            yield self._own(self._folder, sig, codegen)
        installed = installed_directory()
        if installed is not None:
            for processor in running(codegen):
                yield installed / self._name(sig, processor)

    def _own(self, folder: Path, sig: Any, codegen: Any) -> Path:
        return folder / self._name(sig, compiled_for(codegen))

    def _name(self, sig: Any, processor: tuple[str, ...]) -> str:
        return f"{self._key(sig, processor)}.kernel"

    def _key(self, sig: Any, *more: tuple[str, ...]) -> str:
        """A name that depends on everything that the code of a version depends on."""
        key = repr((self._fingerprint, str(sig), *more))
        return f"{self._function.__name__}-{hashlib.sha256(key.encode()).hexdigest()[:32]}"

    def _discard(self, file: Path) -> None:
        if file.parent != self._folder:
            warn_once(
                f"damaged files in {file.parent}: install flexmb again; their kernels are compiled anew till then"
            )
            return
        try:
            if file.is_dir() and not file.is_symlink():
                shutil.rmtree(file)
            else:
                file.unlink(missing_ok=True)
        except OSError:
            pass  # if it cannot be replaced either, `save_overload` warns
        warn_once(f"damaged files in {self._folder}: they were deleted, and their kernels are compiled anew")


def _digest(file: Path, contents: Any) -> bytes:
    """Digest of a file's name and contents, so that a renamed file is not used either."""
    digest = hashlib.sha256(file.name.encode())
    digest.update(contents)
    return digest.digest()
