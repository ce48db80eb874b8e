"""One instance of an FMU by FMPy: FMI 2 and 3, Model Exchange and Co-Simulation, behind one set of calls."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

from crosscheck.engines.fmu.archive import FmuArchive, FmuVariable, Interface

MOST_ITERATIONS = 1000  # of discrete states at one event
MOST_MESSAGES = 20
INTERFACES: dict[Interface, str] = {"model exchange": "ModelExchange", "co-simulation": "CoSimulation"}


class Failed(RuntimeError):
    """The FMU ended the run; the message has what it logged last."""


class Events(NamedTuple):
    """After an event: whether the FMU ends the run, and when its next event on time is (s), infinity for none."""

    ends: bool
    next_s: float


class Instance:
    """An instance in a folder into which its archive is unpacked; `close` it."""

    def __init__(self, archive: FmuArchive, folder: Path, interface: Interface) -> None:
        from fmpy import instantiate_fmu

        self.archive, self._messages = archive, list[str]()
        self.is_second = archive.version == "2.0"
        try:
            self.fmu: Any = instantiate_fmu(
                str(folder), archive.description, fmi_type=INTERFACES[interface], logger=self._log
            )
        except Exception as error:  # FMPy raises Exception itself
            raise Failed(f"{archive.path} cannot be instantiated: {error}{self._told()}") from None

    def close(self) -> None:
        """End and free it."""
        with suppress(Exception):  # an instance that has failed may refuse
            self.fmu.terminate()
        self.fmu.freeInstance()

    def start(self, t: float, tolerance: float | None, values: Iterable[tuple[FmuVariable, float]]) -> None:
        """Initialise at a time (s), for a relative tolerance, with values of variables in their own units."""
        try:
            if self.is_second:
                self.fmu.setupExperiment(tolerance=tolerance, startTime=t)
                self._set(values)
                self.fmu.enterInitializationMode()
            else:
                self._set(values)
                self.fmu.enterInitializationMode(tolerance=tolerance, startTime=t)
            self.fmu.exitInitializationMode()
        except Exception as error:
            raise self.failed(f"it cannot begin at t = {t:g} s", error) from None

    def get(self, variables: Sequence[FmuVariable]) -> list[float]:
        """Values of variables in their own units."""
        whole = dict.fromkeys((each.reference, each.size) for each in variables)
        read = self.fmu.getReal if self.is_second else self.fmu.getFloat64
        found: dict[int, list[float]] = {}
        single = [reference for reference, size in whole if size == 1]
        if single:
            found |= {reference: [value] for reference, value in zip(single, read(single), strict=True)}
        found |= {reference: read([reference], size) for reference, size in whole if size != 1}
        return [found[each.reference][each.element] for each in variables]

    def events(self) -> Events:
        """Update discrete states until they stay, from event mode; then continuous time (of Model Exchange)."""
        update = self.fmu.newDiscreteStates if self.is_second else self.fmu.updateDiscreteStates
        for _ in range(MOST_ITERATIONS):
            again, ends, _, _, has_next, next_s = update()
            if ends or not again:
                self.fmu.enterContinuousTimeMode()
                return Events(bool(ends), float(next_s) if has_next else inf)
        raise Failed(f"its discrete states do not settle in {MOST_ITERATIONS} iterations at one event")

    def step(self, t: float, size: float) -> bool:
        """One communication step (s) of Co-Simulation; whether the FMU ends the run after it."""
        answer = self.fmu.doStep(currentCommunicationPoint=t, communicationStepSize=size)
        if self.is_second:
            return False
        _, ends, early, last = answer
        if early and last < t + size * (1.0 - 1e-9):
            raise Failed(f"it returned at t = {last:g} s, before the end of its step, which was not allowed")
        return bool(ends)

    def failed(self, what: str, error: BaseException) -> Failed:
        """The error of a call, with what the FMU logged last."""
        return Failed(f"{what}: {error}{self._told()}")

    def _set(self, values: Iterable[tuple[FmuVariable, float]]) -> None:
        """Set numbers; those of an array together with its other start values."""
        whole: dict[int, tuple[FmuVariable, list[float]]] = {}
        for variable, value in values:
            if variable.reference not in whole:
                kept = self.get([variable._replace(element=i) for i in range(variable.size)]) if (
                    variable.size > 1) else [0.0]  # fmt: skip
                whole[variable.reference] = variable, kept
            whole[variable.reference][1][variable.element] = value
        write = self.fmu.setReal if self.is_second else self.fmu.setFloat64
        for reference, (_, numbers) in whole.items():
            write([reference], numbers)

    def _log(self, *said: Any) -> None:
        """What the FMU logs; the text is the last argument in all versions."""
        text = said[-1]
        self._messages.append(text.decode("utf-8", "replace") if isinstance(text, bytes) else str(text))
        del self._messages[:-MOST_MESSAGES]

    def _told(self) -> str:
        return f'; it says: "{self._messages[-1].strip()}"' if self._messages else ""
