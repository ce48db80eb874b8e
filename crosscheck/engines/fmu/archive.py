"""An FMU as a file: what its modelDescription.xml says, read and checked before any of its code is loaded."""

from __future__ import annotations

import hashlib
import re
import xml.etree.ElementTree as ET
import zipfile
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, Literal, NamedTuple

from crosscheck.engines.fmu.bad import BadFmu
from crosscheck.engines.fmu.units import Unit
from flexmb.kept import kept
from flexmb.scene.problems import closest

Interface = Literal["model exchange", "co-simulation"]
DESCRIPTION = "modelDescription.xml"
REALS = ("Real", "Float64")
ELEMENT = re.compile(r"(.+)\[(\d+(?:,\d+)*)\]")


class FmuVariable(NamedTuple):
    """A real number of a model: an element, counted from 0, of a variable that has `size` of them.

    start: as the description gives it, None where there is none; unit: as declared, None where none is.
    """

    name: str
    reference: int
    size: int
    element: int
    causality: str
    variability: str
    initial: str
    start: float | None
    unit: Unit | None

    @property
    def fixed(self) -> str:
        """Why the number cannot be set before a run, "" if it can be."""
        if self.variability == "constant":
            return "it is constant"
        if self.causality == "calculatedParameter":
            return "the model calculates it from other parameters"
        if self.causality == "independent":
            return "it is the time"
        if self.causality not in ("parameter", "input") and self.initial not in ("exact", "approx"):
            return "the model calculates it"
        return ""


class OwnDigests(NamedTuple):
    """What an FMU that flexmb has exported says of its scene: digests of the scene, and of it without start values."""

    scene: str
    model: str


@dataclass(frozen=True)
class FmuArchive:
    """An FMU that this machine can run. `digest` is that of the file; `own`, if flexmb has exported it, its digests.

    `description` is FMPy's.
    """

    path: Path
    digest: str
    version: str
    name: str
    interfaces: dict[Interface, str]
    description: Any
    own: OwnDigests | None

    def variable(self, name: str) -> FmuVariable:
        """The real number called so; an element of an array as "x[2]" or "R[1,3]", from 1. BadFmu if there is none."""
        found = self._by_name.get(name)
        if found is not None:
            if _size(found) != 1:
                raise BadFmu(
                    f'{self.path}: variable "{name}" has {_size(found)} numbers, and one is wanted: name an element, '
                    f'such as "{name}[1]"'
                )
            return self._number(found, name, 0)
        element = ELEMENT.fullmatch(name)
        whole = self._by_name.get(element[1]) if element else None
        if element is None or whole is None:
            raise BadFmu(f'{self.path} has no variable "{name}": {closest(name, self._by_name)}')
        place = tuple(int(each) for each in element[2].split(","))
        shape = tuple(whole.shape or ())
        if len(place) != len(shape) or not all(1 <= at <= count for at, count in zip(place, shape, strict=True)):
            raise BadFmu(f'{self.path}: "{name}" is outside of variable "{element[1]}", whose size is {list(shape)}')
        number = 0
        for at, count in zip(place, shape, strict=True):
            number = number * count + at - 1
        return self._number(whole, name, number)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all variables."""
        return tuple(self._by_name)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs, an array by its whole name."""
        return tuple(name for name, each in self._by_name.items() if each.causality == "input")

    @kept
    def _by_name(self) -> dict[str, Any]:
        return {each.name: each for each in self.description.modelVariables}

    def _number(self, found: Any, name: str, element: int) -> FmuVariable:
        if found.type not in REALS:
            raise BadFmu(f'{self.path}: variable "{name}" is of type {found.type}: only {" and ".join(REALS)} are read')
        starts = str(found.start).split() if found.start is not None else []
        start = float(starts[min(element, len(starts) - 1)]) if starts else None
        return FmuVariable(
            name, found.valueReference, _size(found), element, found.causality or "local",
            found.variability or "continuous", found.initial or "", start, self._unit(found),
        )  # fmt: skip

    def _unit(self, found: Any) -> Unit | None:
        declared = found.unit or (found.declaredType.unit if found.declaredType is not None else None)
        if declared is None:
            return None
        base = next((each.baseUnit for each in self.description.unitDefinitions if each.name == declared), None)
        if base is None:
            return None  # a name without a meaning: the mapping states the unit
        if any(getattr(base, other) for other in ("A", "K", "mol", "cd")):
            return Unit(declared, 1.0, (99, 99, 99))  # no quantity of mechanics
        exponents = int(base.kg), int(base.m), int(base.s)
        return Unit(declared, float(base.factor), exponents, float(base.offset))


def _size(variable: Any) -> int:
    size = 1
    for count in variable.shape or ():
        size *= int(count)
    return size


def read_archive(path: Path) -> FmuArchive:
    """The FMU in a file, whose code is not loaded. BadFmu for a file that is none, or that cannot run here."""
    if not path.is_file():
        raise BadFmu(f"{path}: there is no such file" if not path.exists() else f"{path} is a folder, and no FMU")
    try:
        content = path.read_bytes()
        with zipfile.ZipFile(path) as archive:
            if (broken := archive.testzip()) is not None:
                raise BadFmu(f'{path} is corrupted at "{broken}": copy or export it again')
            names = archive.namelist()
            text = archive.read(DESCRIPTION) if DESCRIPTION in names else None
    except (zipfile.BadZipFile, zipfile.LargeZipFile, OSError, EOFError, NotImplementedError, RuntimeError) as error:
        if isinstance(error, BadFmu):
            raise
        raise BadFmu(f"{path} is no zip archive, as an FMU is, or is corrupted: {error}") from None
    except Exception as error:  # zlib's errors have no common class with these
        raise BadFmu(f"{path} is corrupted: {error}") from None
    if text is None:
        raise BadFmu(f"{path} is no FMU: it has no {DESCRIPTION}")
    _check_names(path, names)
    root = _root(path, text)
    version = root.get("fmiVersion", "")
    if version != "2.0" and not version.startswith("3."):
        raise BadFmu(f"{path} is of FMI {version or 'without a version'}: export it as FMI 2.0 or 3.0")
    described = _described(path)
    interfaces = _interfaces(path, described)
    _check_platform(path, version, names, set(interfaces.values()))
    return FmuArchive(
        path, hashlib.sha256(content).hexdigest()[:16], version, described.modelName or path.stem, interfaces,
        described, _own(root),
    )  # fmt: skip


def _root(path: Path, text: bytes) -> ET.Element:
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise BadFmu(f"{path}: its {DESCRIPTION} has a document type, which FMI has not")
    try:
        return ET.fromstring(text)
    except ET.ParseError as error:
        raise BadFmu(f"{path}: its {DESCRIPTION} is no XML: {error}") from None


def _check_names(path: Path, names: list[str]) -> None:
    """Files that would be written outside of the folder into which the archive is unpacked."""
    for name in names:
        if "\\" in name or ":" in name or name.startswith("/") or ".." in PurePosixPath(name).parts:
            raise BadFmu(f'{path} has a file "{name}", which leads out of the archive: do not use it')


def _described(path: Path) -> Any:
    from fmpy import read_model_description

    try:
        return read_model_description(str(path), validate=False)
    except Exception as error:  # of FMPy and lxml, without a common class
        raise BadFmu(f"{path}: its {DESCRIPTION} cannot be read: {error}") from None


def _interfaces(path: Path, described: Any) -> dict[Interface, str]:
    offered: dict[Interface, Any] = {
        "model exchange": described.modelExchange, "co-simulation": described.coSimulation,
    }  # fmt: skip
    found = {name: each for name, each in offered.items() if each is not None}
    if not found:
        raise BadFmu(f"{path} offers neither Model Exchange nor Co-Simulation: export it for one of them")
    usable = {name: str(each.modelIdentifier) for name, each in found.items() if not each.needsExecutionTool}
    if not usable:
        raise BadFmu(f"{path} needs the tool that made it to run: export it with all that it needs")
    return usable


def _check_platform(path: Path, version: str, names: list[str], identifiers: set[str]) -> None:
    """The library for this machine, where FMPy will load it from."""
    import fmpy

    folder = fmpy.platform if version == "2.0" else fmpy.platform_tuple
    for identifier in identifiers:
        if f"binaries/{folder}/{identifier}{fmpy.sharedLibraryExtension}" not in names:
            there = sorted({PurePosixPath(name).parts[1] for name in names if name.startswith("binaries/") and
                            len(PurePosixPath(name).parts) > 2})  # fmt: skip
            has = f"it has libraries for {', '.join(there)}" if there else "it has no libraries"
            raise BadFmu(f"{path} cannot run on this platform, {folder}: {has}: export it for {folder}")


def _own(root: ET.Element) -> OwnDigests | None:
    if not root.get("generationTool", "").startswith("flexmb "):
        return None
    for each in root.iter():
        if each.tag.rpartition("}")[2] == "digests" and each.get("scene"):
            return OwnDigests(each.get("scene", ""), each.get("model", ""))
    return None
