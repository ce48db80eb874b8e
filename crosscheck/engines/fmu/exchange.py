"""Model Exchange: the equations of an FMU in FMPy's CVode, step by step, with the events that the FMU asks for.

CVode's own steps end at events on time and at the crossings of event indicators, never at samples, which are found by
its interpolation of the step that contains them. After every step the FMU is told that it is complete, if it needs to.
"""

from __future__ import annotations

import ctypes as ct
from collections.abc import Callable
from math import inf
from typing import Any

import numpy as np

from crosscheck.engines.fmu.instance import Failed, Instance
from flexmb.typing import Real

MOST_STEPS = 10**7  # within one call of CVode, which makes one step a call
ONE_STEP = 2
ROOT, STOPPED = 2, 1  # what CVode returns
AGAIN, NEVER = 1, -1  # what a right-hand side returns: a shorter step may do, or none will
DISCARD = 2  # a status of FMI
LEAST_PARTS = 50.0  # of a run, as FMPy has it: so that CVode steps over nothing


def exchanged(instance: Instance, times: Real, tolerance: float, sample: Callable[[], None]) -> tuple[int, int, str]:
    """Integrate from the first of `times` (T,) s to the last, with `sample` called when the FMU is at each of them.

    Returns the evaluations of the right-hand side, the steps, and why it stopped early, "" if it did not.
    """
    fmu, t = instance.fmu, float(times[0])
    told = instance.archive.description.modelExchange.needsCompletedIntegratorStep
    solver: Any = None
    steps = 0
    try:
        events = instance.events()
        sample()
        if events.ends:
            return 0, 0, f"the FMU ended the run at t = {t:g} s"
        solver = _integrator(instance, t, float(times[-1]), tolerance)
        waiting = list(map(float, times[1:]))
        while waiting:
            before, (crossed, t) = t, solver.advance(min(events.next_s, waiting[-1]))
            steps += 1
            if t > before:
                solver.fault = None  # a shorter step has overcome it
            elif not crossed:
                raise Failed("steps become too small to go on")
            while waiting and waiting[0] < t:
                solver.look_back(waiting.pop(0))
                sample()
            solver.settle(t)
            wanted, ends = fmu.completedIntegratorStep() if told else (False, False)
            if not ends and (crossed or wanted or t >= events.next_s):
                fmu.enterEventMode()
                events = instance.events()
                ends = events.ends
                solver.reset(t)
            if waiting and waiting[0] <= t:
                waiting.pop(0)
                sample()
            if ends:
                return solver.evaluations, steps, f"the FMU ended the run at t = {t:g} s"
    except Exception as error:
        cause = solver.fault if solver is not None and solver.fault is not None else error
        evaluations = solver.evaluations if solver is not None else 0
        return evaluations, steps, str(instance.failed(f"stopped after t = {t:g} s", cause))
    return solver.evaluations, steps, ""


def _integrator(instance: Instance, t: float, end: float, tolerance: float) -> Any:
    from fmpy.fmi1 import FMICallException
    from fmpy.sundials import CVodeSolver, cvode, nvector_serial

    stop_at, interpolated = cvode.sundials_cvode.CVodeSetStopTime, cvode.sundials_cvode.CVodeGetDky
    stop_at.argtypes, stop_at.restype = [ct.c_void_p, ct.c_double], ct.c_int
    interpolated.argtypes, interpolated.restype = [ct.c_void_p, ct.c_double, ct.c_int, ct.c_void_p], ct.c_int
    fmu, described = instance.fmu, instance.archive.description

    class CvodeOfFmu(CVodeSolver):
        """FMPy's, of which an error of the FMU in a callback ends the run, where FMPy's goes on with what is there."""

        def __init__(self) -> None:
            self.fault: BaseException | None = None
            self.evaluations = 0
            self._rates = nvector_serial.NV_DATA_S
            super().__init__(
                nx=described.numberOfContinuousStates, nz=described.numberOfEventIndicators,
                get_x=fmu.getContinuousStates, set_x=fmu.setContinuousStates,
                get_dx=fmu.getDerivatives if instance.is_second else fmu.getContinuousStateDerivatives,
                get_z=fmu.getEventIndicators, get_nominals=fmu.getNominalsOfContinuousStates, set_time=fmu.setTime,
                input=_NoInput(), startTime=t, maxStep=(end - t) / LEAST_PARTS, relativeTolerance=tolerance,
                maxNumSteps=MOST_STEPS,
            )  # fmt: skip

        def f(self, t: float, y: Any, ydot: Any, data: Any) -> int:
            self.evaluations += 1
            answer = self._answer(super().f, t, y, ydot, data)
            if answer == 0 and not np.isfinite(np.ctypeslib.as_array(self._rates(ydot), (self.nx,))).all():
                self.fault = Failed("its derivatives are not finite")  # CVode would look for a step for ever
                return AGAIN
            return answer

        def g(self, t: float, y: Any, out: Any, data: Any) -> int:
            return self._answer(super().g, t, y, out, data)

        def _answer(self, function: Callable[..., int], *arguments: Any) -> int:
            try:
                return function(*arguments)
            except FMICallException as error:
                self.fault = error
                return AGAIN if error.status == DISCARD else NEVER
            except BaseException as error:  # a callback cannot raise through C
                self.fault = error
                return NEVER

        def advance(self, goal: float) -> tuple[bool, float]:
            """One step, at most to `goal` (s): whether an event indicator has crossed zero, and the time at its end."""
            reached = ct.c_double(0.0)
            if stop_at(self.cvode_mem, goal) != 0:
                raise Failed(f"CVode cannot go on to t = {goal:g} s")
            flag = cvode.CVode(self.cvode_mem, goal, self.x, ct.byref(reached), ONE_STEP)
            if flag < 0:
                raise Failed(f"CVode: {self.error_info[3] if self.error_info else f'error {flag}'}")
            return flag == ROOT, reached.value if flag != STOPPED else goal

        def look_back(self, t: float) -> None:
            """Put the FMU to a time within the last step."""
            if not self.discrete:
                now = np.ctypeslib.as_array(self.px, (self.nx,))
                end = now.copy()
                if interpolated(self.cvode_mem, t, 0, self.x) != 0:
                    raise Failed(f"CVode cannot interpolate at t = {t:g} s")
            fmu.setTime(t)
            if not self.discrete:
                self.set_x(self.px, self.nx)
                now[:] = end

        def settle(self, t: float) -> None:
            """Put the FMU to the end of the last step."""
            fmu.setTime(t)
            if not self.discrete:
                self.set_x(self.px, self.nx)

    return CvodeOfFmu()


class _NoInput:
    """What FMPy's solver asks for inputs, which are constant here."""

    def apply(self, t: float) -> None:
        """Nothing changes."""

    def nextEvent(self, t: float) -> float:
        """Nor later."""
        return inf
