"""A scene as an FMU, or as C with one header."""

from __future__ import annotations

import subprocess
import tempfile
import zipfile
from collections.abc import Sequence
from hashlib import sha256
from html import escape
from math import inf
from pathlib import Path

from flexmb.export.description import LICENSE, Version, description
from flexmb.export.emitted import LEVEL
from flexmb.export.model import ExportedModel, model
from flexmb.export.refusals import NotExportable, c_compiler
from flexmb.export.sources import core, example, header, instance, interface
from flexmb.output.files import folder as made
from flexmb.output.files import whole_file, write_whole
from flexmb.scene.schema import Scene

FLAGS = (
    "-std=gnu11", "-O2", "-g0", "-fPIC", "-shared", "-fvisibility=hidden", "-s", "-Wl,--build-id=none",
    "-Wl,-z,noexecstack", "-Wl,-z,defs",
)  # fmt: skip
"""For a library that names neither a folder nor a machine: no debugging information, no number of the build."""
PLATFORM: dict[Version, str] = {"2": "linux64", "3": "x86_64-linux"}
"""The folder of a library."""
EPOCH = (1980, 1, 1, 0, 0, 0)  # of all files in an archive, so that equal scenes give equal archives


def export_fmu(
    scene: Scene, path: Path, *, inputs: Sequence[str] = (), step: float | None = None, derivatives: bool = False,
    fmi: Version = "2",
) -> ExportedModel:  # fmt: skip
    """Write a scene as an FMU for Linux on x86-64, which needs no Python: docs/export-fmu.md. fmi: "2", or "3" for 3.0.

    inputs: paths of loads, motors and actuators that are inputs instead of their functions of time; constant ones are
    inputs, too. step (s): the archive is for Co-Simulation, too, by the classical Runge-Kutta method in equal steps of
    at most this size. derivatives: with directional derivatives by states and inputs. Takes some 15 s of compiling for
    a kind of scene, with derivatives some 40 s.

    Raises NotExportable, before anything is compiled, for controllers and events, another platform, where no C
    compiler is found, and for derivatives of scenes that have none; ClosureError for loops that cannot be closed or
    allow no motion; SceneError for a scene that is wrong, PathError for an input that is not there, ValueError for a
    step that is not positive, OSError where the file cannot be written.
    """
    _check_step(step)
    c_compiler()
    made_of = model(scene, inputs, derivatives)
    write_fmu(made_of, path, step, fmi)
    return made_of


def export_c(
    scene: Scene, folder: Path, *, inputs: Sequence[str] = (), derivatives: bool = False, target: str = LEVEL
) -> ExportedModel:
    """Write a scene as C into a folder: a header, its functions, an object file and an example program.

    The functions allocate nothing; an instance is one struct. Compile with `cc example.c NAME.c NAME_kernels.o -lm`.
    target: the processors that the object file is for (`flexmb.export.emitted.TARGETS`), x86-64 by default. inputs,
    derivatives and errors: as of `export_fmu`; no C compiler is needed for the export itself. ValueError for another
    target.
    """
    made_of = model(scene, inputs, derivatives, target)
    write_c(made_of, folder)
    return made_of


def write_fmu(model: ExportedModel, path: Path, step: float | None = None, fmi: Version = "2") -> None:
    """Write a model as `export_fmu` does."""
    _check_step(step)
    size = step or 0.0
    parts = header(model), core(model), instance(model), interface(model, fmi, "", size)
    code = sha256("".join(parts).encode() + model.code).hexdigest()
    guid = "{" + "-".join((code[:8], code[8:12], code[12:16], code[16:20], code[20:32])) + "}"
    contents = {
        "modelDescription.xml": description(model, fmi, guid, size, code).encode(),
        f"binaries/{PLATFORM[fmi]}/{model.identifier}.so": _library(c_compiler(), model, fmi, guid, size),
        "documentation/index.html": _page(model).encode(),
        "documentation/licenses/license.txt": f"{LICENSE}\n".encode(),
    }
    with whole_file(path) as beside, zipfile.ZipFile(beside, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            entry = zipfile.ZipInfo(name, EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content)


def write_c(model: ExportedModel, folder: Path) -> None:
    """Write a model as `export_c` does."""
    name = made(folder) / model.identifier
    write_whole(name.with_suffix(".h"), header(model))
    write_whole(name.with_suffix(".c"), core(model))
    write_whole(name.with_name(f"{model.identifier}_kernels.o"), model.code)
    write_whole(name.with_name("example.c"), example(model))


def _check_step(step: float | None) -> None:
    if step is not None and not 0.0 < step < inf:
        raise ValueError(f"step is {step:g} s: give a positive one, or leave it out for Model Exchange only")


def _library(compiler: str, model: ExportedModel, fmi: Version, guid: str, step: float) -> bytes:
    """The shared library; its sources lie in a folder that does not outlive it, and are named without it."""
    name = model.identifier
    with tempfile.TemporaryDirectory() as place:
        work = Path(place)
        write_whole(work / f"{name}.h", header(model))
        write_whole(work / "instance.c", instance(model))
        write_whole(work / "model.c", core(model) + "\n" + interface(model, fmi, guid, step))
        write_whole(work / "kernels.o", model.code)
        command = [compiler, *FLAGS, "-o", f"{name}.so", "model.c", "kernels.o", "-lm"]
        done = subprocess.run(command, cwd=work, capture_output=True, text=True, errors="replace")
        if done.returncode:
            said = done.stderr.strip().splitlines()
            last = next((line for line in said if "error" in line), (said or ["no message"])[-1])
            raise NotExportable(f"{Path(compiler).name} could not make the library, is its linker installed? {last}")
        return (work / f"{name}.so").read_bytes()


def _page(model: ExportedModel) -> str:
    """What of the scene the model can change, and what is fixed, with the reason."""
    rows = ((escape(name), escape(why)) for name, why in model.numbers.fixed.items())
    fixed = "".join(f"<tr><td>{name}</td><td>{why}</td></tr>" for name, why in rows)
    return (
        f'<!DOCTYPE html><html lang="en"><meta charset="utf-8"><title>{escape(model.name)}</title>'
        f"<h1>{escape(model.name)}</h1><p>{escape(model.description)}</p>"
        "<p>Names, units and start values are in modelDescription.xml. Numbers of the scene that are neither "
        "parameters there nor in this table are fixed: modal quantities or directions are computed from them.</p>"
        f"<p>{escape(model.open_loads)}</p>"
        f"<table><tr><th>fixed</th><th>why</th></tr>{fixed}</table></html>\n"
    )
