"""The variational equations of one part of a run between two events, integrated in compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.integrate.control import ACCEPTED, COUNTS, REJECTED, SAMPLES, STOP
from flexmb.integrate.problem import Accuracy, Clock, problem
from flexmb.integrate.settings import Settings
from flexmb.integrate.watch import nothing_watched
from flexmb.jit.direct import address
from flexmb.jit.duals import DUAL, RATES
from flexmb.run.driver import Leg
from flexmb.run.interruption import interruptible
from flexmb.run.outputs import ending
from flexmb.run.propagate import Integration
from flexmb.run.times import clock_of
from flexmb.sensitivity import flow
from flexmb.sensitivity.blocks import Blocks, ObservedRates
from flexmb.sensitivity.loops import Loops
from flexmb.system.pushforward import Directions, GivenMotion, pushforward
from flexmb.tables.state import DynamicsError
from flexmb.tables.status import OK, Status
from flexmb.typing import Real

# Derivatives are as smooth as the motion, but for singular positions: they take about its number of steps.
MORE_STEPS = 30
FEW_STEPS = 1000  # allowed in any case, where the motion itself takes hardly a step


class Course(NamedTuple):
    """A state y (n,) = [q, u, x, work] and its scaled derivatives (n,P)."""

    y: Real
    Y: Real


class Variation:
    """The flow of one part of a run: its tables, and their evaluation at one state."""

    def __init__(self, leg: Leg, blocks: Blocks, loops: Loops | None) -> None:
        self.leg, self.blocks, self.loops = leg, blocks, loops
        system = blocks.system
        n, B = system.nq + system.nu + 1, len(blocks)
        where = np.zeros(flow.ADDRESSES, np.int64)
        where[flow.MOTION], where[flow.MANIFOLD] = blocks.motion, blocks.manifold
        where[flow.OBSERVING], where[flow.CLOSURE_LOADS] = blocks.observing_at, blocks.closure_loads_at
        (law, law_rate), continuous = np.zeros((2, B, 0, DUAL.width)), np.zeros(0, np.int64)
        if loops is not None:
            where[flow.CONTROL], where[flow.FOLLOW] = loops.steer, loops.follow
            law, law_rate, continuous = loops.law, loops.law_rate, loops.continuous
        self._width = n + len(continuous)
        self._motion = np.r_[: n - 1, self._width - 1]
        self.flow = flow.VariationalFlow(
            address=where, block=np.array(blocks.where), loop=np.array(loops.where if loops else [0] * B),
            output=np.array([address(each) for each in blocks.outputs]), load=np.array(blocks.where_loads),
            directions=np.array([blocks.directions]), state=blocks.state, slope=blocks.slope, every=blocks.every,
            law=law, law_rate=law_rate, continuous=continuous,
        )  # fmt: skip

    def joined(self, at: Course) -> Real:
        """z of a state with its derivatives."""
        z = np.empty((len(at.y), 1 + at.Y.shape[1]))
        z[:, 0], z[:, 1:] = at.y, at.Y
        return z.ravel()

    def parted(self, z: Real) -> Course:
        """The inverse of `joined`, of one state or of several, (T,n) and (T,n,P)."""
        rows = z.reshape(*z.shape[:-1], self._width, -1)
        return Course(rows[..., 0].copy(), rows[..., 1:].copy())

    def slope(self, t: float, at: Course) -> Course:
        """The rates of a state and of its derivatives; DynamicsError where they do not exist."""
        z = self.joined(at)
        rates = np.zeros(len(z))
        self._choose_rows(t, z)
        self.check(flow.rhs(t, z, rates, self.flow, self.flow), t)
        return self.parted(rates)

    def put(self, t: float, z: Real) -> None:
        """Evaluate all blocks at a state that is `joined` with its derivatives."""
        self._choose_rows(t, z)
        for b in range(len(self.blocks)):
            self.check(flow.evaluate_at(t, z, b, self.flow), t)

    def observed(self, times: Real, states: Real) -> ObservedRates:
        """Everything observable at times (T,), in states (T,.) that are `joined` with their derivatives."""
        T, m, P = len(times), self.blocks.every.shape[1], self.blocks.directions
        found = ObservedRates(np.empty((T, m)), np.empty((T, m, P)))
        # A chain chooses its rows anew for each time; all times of a tree are observed in one call.
        parts = [slice(0, T)] if self.blocks.system.closures is None else [slice(i, i + 1) for i in range(T)]
        for part in parts if T else ():
            self._choose_rows(float(times[part.start]), states[part.start])
            status, count = flow.observe_at(times[part], states[part], *(each[part] for each in found), self.flow)
            if status != OK:
                self.check(status, float(times[part.start + count]))
        return found

    def observed_at(self, t: float, at: Course) -> ObservedRates:
        """The same at one state: (m,) and (m,P)."""
        found = self.observed(np.array([t]), self.joined(at)[None])
        return ObservedRates(found.row[0], found.rates[0])

    def _choose_rows(self, t: float, z: Real) -> None:
        """Have a chain choose its independent rows where it is evaluated, or where a run begins: integrators do at each
        step that they accept, but nothing may have been integrated, or another run to somewhere else."""
        self.blocks.choose_rows(t, z.reshape(self._width, -1)[self._motion, 0])

    def take(self, at: Course) -> None:
        """Set the states of all blocks without evaluating them."""
        tables = self.flow
        motion, laws = self._motion, np.arange(len(self._motion) - 1, self._width - 1)
        for b, (state, law) in enumerate(zip(tables.state, tables.law, strict=True)):
            lanes = slice(RATES * b, min(RATES * (b + 1), at.Y.shape[1]))
            state[:, 0], state[:, 1 : 1 + lanes.stop - lanes.start] = at.y[motion], at.Y[motion, lanes]
            law[tables.continuous, 0] = at.y[laws]
            law[tables.continuous, 1 : 1 + lanes.stop - lanes.start] = at.Y[laws, lanes]

    def energy_rates(self, t: float, at: Course, dt: Real) -> Real:
        """The derivatives (P,) of the energy at a state whose time (s) changes by dt (P,)."""
        place, _ = self.blocks.system.observation.columns["energy"]
        rates: Real = np.sum(self.observed_at(t, at).rates[place], axis=0)
        return rates + self._energy_by_time(t, at.y) * dt if np.any(dt) else rates

    def _energy_by_time(self, t: float, y: Real) -> Real:
        """The explicit derivative () of the energy by time: what is prescribed moves on, whatever its entries in y."""
        system = self.blocks.system
        c, observation, chain = system.constants, system.observation, system.closures
        if not np.any(c.speed["prescribed"] >= 0):
            return np.zeros(())
        place, _ = observation.columns["energy"]
        closures = None if chain is None else chain.constants[1]
        push = pushforward(c, system.own_tangent, observation.out, system.check_status, closures)
        n, none = system.nq + system.nu, np.zeros((system.nu, 1))
        loads = np.zeros((0 if closures is None else len(closures.row), 1))
        at = GivenMotion(t, np.concatenate([y[:n], y[-1:]]), none[:, 0], loads[:, 0])
        later = Directions(np.zeros((n, 1)), none, loads, np.ones(1))
        return np.asarray(np.sum(push.derivatives(at, later, lambda lanes: push.row(lanes)[place])))

    def check(self, status: int, t: float) -> None:
        """DynamicsError with the time, unless a status is OK."""
        if status != OK:
            error = DynamicsError(f"derivatives {ending(self.blocks.system, Status(status), self.blocks.fault, t)}")
            error.status = Status(status)
            raise error

    def integrate(self, start: Course, times: Real, clock: Clock, settings: Settings) -> Real:
        """The state with its derivatives, `joined`, at these times (T,) s, from the first to the last."""
        z, P = self.joined(start), self.blocks.directions
        self._choose_rows(float(times[0]), z)
        plain = settings.accuracy(self.blocks.system.nq, self.blocks.system.nu)
        steps = self.leg.raw.counts[ACCEPTED] + self.leg.raw.counts[REJECTED]
        most = min(settings.max_steps, MORE_STEPS * steps + FEW_STEPS)
        accuracy: Accuracy = plain._replace(controlled=(self._width - 1) * (1 + P), max_steps=most)
        posed = problem(flow.rhs, flow.project, self.flow, self.flow)
        method, counts, out = settings.integrator, np.zeros(COUNTS, np.int64), np.empty((len(times), len(z)))
        given = z, clock._replace(times=times), accuracy, out, counts, method.memory(len(z)), nothing_watched()
        run = method.entered(posed, *given)
        (status, t), interrupted = interruptible(lambda *given: run(posed, *given), given, counts[STOP : STOP + 1])
        if interrupted:
            raise KeyboardInterrupt
        if status == Status.MAX_STEPS and most < settings.max_steps:
            raise DynamicsError(
                f"derivatives stopped at t = {t:g} s: they would take more than {MORE_STEPS} times the steps of the "
                "run. Either they grow without bound there: a closed chain has no derivative beyond a singular "
                "position, where branches of its motion meet; start elsewhere, or end the run before. Or they round "
                f"by more than the tolerances, atol = {settings.atol:g}, as where a loop has a body that is light "
                "beside the others: give a larger rtol and atol"
            )
        self.check(status, t)
        return out[: counts[SAMPLES]]


def clock_of_leg(solve: Integration, leg: Leg, times: Real, settings: Settings) -> tuple[Real, Clock]:
    """The state at the start of a part of a run, with those of controllers, and its clock; begins the controllers."""
    begin, fixed = leg.begin, settings.integrator.fixed
    clock = clock_of(solve.system, begin.state.t, times, fixed, breaks=True)
    accuracy, counts = settings.accuracy(solve.system.nq, solve.system.nu), np.zeros(COUNTS, np.int64)
    y, clock, _ = solve.begin(begin._replace(y=begin.y.copy()), clock, accuracy, counts)
    return y, clock
