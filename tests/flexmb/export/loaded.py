"""A library of FMI 2.0 as a tool uses it, by ctypes: what the tests need where fmpy is not installed."""

from __future__ import annotations

import ctypes as ct
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

LOGGER = ct.CFUNCTYPE(None, ct.c_void_p, ct.c_char_p, ct.c_int, ct.c_char_p, ct.c_char_p, ct.c_char_p)
ALLOCATE = ct.CFUNCTYPE(ct.c_void_p, ct.c_size_t, ct.c_size_t)
FREE = ct.CFUNCTYPE(None, ct.c_void_p)
EXCHANGE, SIMULATION = 0, 1


class Callbacks(ct.Structure):
    """fmi2CallbackFunctions."""

    _fields_ = (
        ("logger", LOGGER), ("allocate", ALLOCATE), ("free", FREE), ("finished", ct.c_void_p), ("place", ct.c_void_p),
    )  # fmt: skip


class EventInfo(ct.Structure):
    """fmi2EventInfo."""

    _fields_ = (
        *((name, ct.c_int) for name in ("again", "ends", "nominals", "states", "has_next")),
        ("next", ct.c_double),
    )


class Fmu:
    """An archive, unpacked: its library, and its variables by name."""

    FOLDER = "linux64"

    def __init__(self, path: Path, folder: Path) -> None:
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
            self.contents = {name: archive.read(name) for name in archive.namelist()}
        self.root = ET.fromstring(self.contents["modelDescription.xml"])
        variables = self.root.findall("ModelVariables/ScalarVariable")
        self.numbers = {each.get("name"): int(each.get("valueReference", "")) for each in variables}
        self.causality = {each.get("name"): each.get("causality") for each in variables}
        self.unit = {each.get("name"): each[0].get("unit") for each in variables}
        [library] = (folder / "binaries" / self.FOLDER).iterdir()
        self.library = ct.CDLL(str(library))

    def instance(self, kind: int = EXCHANGE, guid: str | None = None) -> Instance:
        """A new instance."""
        return Instance(self, kind, self.root.get("guid", "") if guid is None else guid)


class Instance:
    """An instance, with the messages that it has logged."""

    def __init__(self, fmu: Fmu, kind: int, guid: str) -> None:
        self.fmu, self.messages = fmu, list[str]()
        libc = ct.CDLL(None)
        libc.calloc.restype, libc.calloc.argtypes, libc.free.argtypes = ct.c_void_p, (ct.c_size_t,) * 2, (ct.c_void_p,)

        def log(_place: Any, _name: Any, _status: Any, _kind: Any, _form: Any, text: bytes) -> None:
            self.messages.append(text.decode())

        self._callbacks = Callbacks(LOGGER(log), ALLOCATE(libc.calloc), FREE(libc.free), None, None)
        call = fmu.library.fmi2Instantiate
        call.restype = ct.c_void_p
        self.address = call(b"one", kind, guid.encode(), b"", ct.byref(self._callbacks), 0, 0)

    def call(self, name: str, *arguments: Any) -> int:
        """The status of a function."""
        return int(getattr(self.fmu.library, name)(ct.c_void_p(self.address), *arguments))

    def do(self, name: str, *arguments: Any) -> None:
        """Call a function; AssertionError with its message unless it succeeds."""
        assert self.call(name, *arguments) == 0, (name, self.messages)

    def start(self, t: float = 0.0, **values: float) -> Instance:
        """Initialise at a time, with start values by name."""
        self.do("fmi2SetupExperiment", 0, ct.c_double(0.0), ct.c_double(t), 0, ct.c_double(0.0))
        self.do("fmi2EnterInitializationMode")
        self.set(values)
        self.do("fmi2ExitInitializationMode")
        return self

    def events(self) -> EventInfo:
        """New discrete states, then continuous time."""
        info = EventInfo()
        self.do("fmi2NewDiscreteStates", ct.byref(info))
        self.do("fmi2EnterContinuousTimeMode")
        return info

    def references(self, names: Collection[str]) -> Any:
        """Value references of variables by name."""
        return (ct.c_uint * len(names))(*(self.fmu.numbers[name] for name in names))

    def set(self, values: dict[str, float]) -> None:
        """Set variables by name."""
        self.do(
            "fmi2SetReal",
            self.references(values),
            ct.c_size_t(len(values)),
            (ct.c_double * len(values))(*values.values()),
        )

    def get(self, *names: str) -> Any:
        """Values of variables by name, (n,)."""
        values = np.empty(len(names))
        self.do("fmi2GetReal", self.references(names), ct.c_size_t(len(names)), pointer(values))
        return values

    def rates(self, t: float, y: Any) -> Any:
        """dy/dt (n,) of the state y (n,) at time t."""
        y, dy = np.ascontiguousarray(y, float), np.empty(len(y))
        self.do("fmi2SetTime", ct.c_double(t))
        self.do("fmi2SetContinuousStates", pointer(y), ct.c_size_t(len(y)))
        self.do("fmi2GetDerivatives", pointer(dy), ct.c_size_t(len(y)))
        return dy

    def along(self, unknowns: list[str], direction: dict[str, float]) -> Any:
        """Changes (n,) of variables by name in a direction, in which others change so much."""
        of, by = self.references(unknowns), self.references(direction)
        change, known = np.empty(len(unknowns)), np.array(list(direction.values()), float)
        counts = ct.c_size_t(len(unknowns)), ct.c_size_t(len(direction))
        self.do("fmi2GetDirectionalDerivative", of, counts[0], by, counts[1], pointer(known), pointer(change))
        return change

    def states(self, count: int) -> Any:
        """The present state (count,)."""
        y = np.empty(count)
        self.do("fmi2GetReal", (ct.c_uint * count)(*range(count)), ct.c_size_t(count), pointer(y))
        return y


def pointer(values: Any) -> Any:
    """Numbers for C."""
    return values.ctypes.data_as(ct.POINTER(ct.c_double))
