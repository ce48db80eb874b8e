"""A library of FMI 3.0 as a tool uses it, by ctypes: what tests of FMI 2.0 ask of `loaded`, by the other functions."""

from __future__ import annotations

import ctypes as ct
from pathlib import Path
from typing import Any

import numpy as np

from tests.flexmb.export.loaded import EXCHANGE, EventInfo, Fmu, Instance, pointer

LOGGER = ct.CFUNCTYPE(None, ct.c_void_p, ct.c_int, ct.c_char_p, ct.c_char_p)


class Fmu3(Fmu):
    """An archive of FMI 3.0, unpacked."""

    FOLDER = "x86_64-linux"

    def __init__(self, path: Path, folder: Path) -> None:
        super().__init__(path, folder)
        variables = list(self.root.find("ModelVariables") or ())
        self.numbers = {each.get("name"): int(each.get("valueReference", "")) for each in variables}
        self.causality = {each.get("name"): each.get("causality") for each in variables}
        self.unit = {each.get("name"): each.get("unit") for each in variables}

    def instance(self, kind: int = EXCHANGE, guid: str | None = None) -> Instance3:
        """A new instance."""
        return Instance3(self, kind, self.root.get("instantiationToken", "") if guid is None else guid)


class Instance3(Instance):
    """An instance, with the messages that it has logged."""

    def __init__(self, fmu: Fmu3, kind: int, guid: str) -> None:
        self.fmu, self.messages = fmu, list[str]()

        def log(_place: Any, _status: Any, _kind: Any, text: bytes) -> None:
            self.messages.append(text.decode())

        self._logger = LOGGER(log)
        arguments: tuple[Any, ...] = b"one", guid.encode(), b"", False, False
        if kind == EXCHANGE:
            call = fmu.library.fmi3InstantiateModelExchange
        else:
            call = fmu.library.fmi3InstantiateCoSimulation
            arguments += False, False, None, ct.c_size_t(0)
        call.restype = ct.c_void_p
        self.address = call(*arguments, None, self._logger, None)

    def start(self, t: float = 0.0, **values: float) -> Instance3:
        """Initialise at a time, with start values by name."""
        none = ct.c_double(0.0)
        self.do("fmi3EnterInitializationMode", False, none, ct.c_double(t), False, none)
        self.set(values)
        self.do("fmi3ExitInitializationMode")
        return self

    def events(self) -> EventInfo:
        """New discrete states, then continuous time."""
        info, flags, following = EventInfo(), [ct.c_bool() for _ in range(5)], ct.c_double()
        self.do("fmi3UpdateDiscreteStates", *map(ct.byref, (*flags, following)))
        info.states, info.has_next, info.next = flags[3].value, flags[4].value, following.value
        self.do("fmi3EnterContinuousTimeMode")
        return info

    def set(self, values: dict[str, float]) -> None:
        """Set variables by name."""
        count = ct.c_size_t(len(values))
        numbers = self.references(values)
        self.do("fmi3SetFloat64", numbers, count, (ct.c_double * len(values))(*values.values()), count)

    def get(self, *names: str) -> Any:
        """Values of variables by name, (n,)."""
        values, count = np.empty(len(names)), ct.c_size_t(len(names))
        self.do("fmi3GetFloat64", self.references(names), count, pointer(values), count)
        return values

    def rates(self, t: float, y: Any) -> Any:
        """dy/dt (n,) of the state y (n,) at time t."""
        y, dy = np.ascontiguousarray(y, float), np.empty(len(y))
        self.do("fmi3SetTime", ct.c_double(t))
        self.do("fmi3SetContinuousStates", pointer(y), ct.c_size_t(len(y)))
        self.do("fmi3GetContinuousStateDerivatives", pointer(dy), ct.c_size_t(len(y)))
        return dy

    def along(self, unknowns: list[str], direction: dict[str, float]) -> Any:
        """Changes (n,) of variables by name in a direction, in which others change so much."""
        change, known = np.empty(len(unknowns)), np.array(list(direction.values()), float)
        of, by = ct.c_size_t(len(unknowns)), ct.c_size_t(len(direction))
        names = self.references(unknowns), of, self.references(direction), by
        self.do("fmi3GetDirectionalDerivative", *names, pointer(known), by, pointer(change), of)
        return change

    def step(self, t: float, size: float) -> float:
        """A step of Co-Simulation; the time that it has reached."""
        flags, reached = [ct.c_bool() for _ in range(3)], ct.c_double()
        arguments = ct.c_double(t), ct.c_double(size), True, *map(ct.byref, flags), ct.byref(reached)
        self.do("fmi3DoStep", *arguments)
        return reached.value

    def states(self, count: int) -> Any:
        """The present state (count,)."""
        y, n = np.empty(count), ct.c_size_t(count)
        self.do("fmi3GetFloat64", (ct.c_uint * count)(*range(count)), n, pointer(y), n)
        return y
