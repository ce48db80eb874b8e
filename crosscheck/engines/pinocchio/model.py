"""One scene compiled for Pinocchio: evaluate at t = 0, or integrate with SciPy's DOP853."""

from __future__ import annotations

import time
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

from crosscheck.engines.contract import Effort, Run, Snapshot, Status, Trajectory
from crosscheck.engines.functions_of_time import breaks_between, scene_functions
from crosscheck.engines.links import links
from crosscheck.engines.pinocchio.dynamics import Dynamics
from crosscheck.engines.pinocchio.observer import PinocchioObserver
from crosscheck.engines.pinocchio.tree import build_tree
from crosscheck.engines.trajectories import stack
from flexmb.scene.schema import Scene
from flexmb.typing import Real

# Angles of elastic chains are a thousandth of a radian: coarser absolute tolerances let their fastest modes ring.
_SMALL = 1e-3
# Coordinates and speeds are of order one to a hundred, so below this the error control would chase round-off.
_ROUND_OFF = 1e-13


class PinocchioModel:
    def __init__(self, scene: Scene) -> None:
        tree = build_tree(links(scene), np.array(scene.gravity_m_s2, dtype=float))
        self._dynamics = Dynamics(tree, scene)
        self._observer = PinocchioObserver(self._dynamics, scene)
        self._functions = scene_functions(scene)

    def warm_up(self) -> None:
        """Nothing is compiled; touch the code once so that first-call costs are not timed."""
        self._dynamics.rate(0.0, self._dynamics.initial())

    def evaluate(self) -> Snapshot:
        return self._observer.observe(0.0, self._dynamics.state(0.0, self._dynamics.initial()))

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        start = time.perf_counter()
        with np.errstate(over="ignore", invalid="ignore"):  # divergence is a status
            states, evaluations, message = self._integrate(run.times, effort)
        wall = time.perf_counter() - start
        reached = run.times[: len(states)]
        samples = [self._observer.observe(t, self._dynamics.state(t, y)) for t, y in zip(reached, states, strict=True)]
        status: Status = "finished" if len(states) == len(run.times) else "diverged"
        work = np.array([y[-1] for y in states])
        return stack(reached, samples, status=status, message=message, wall_s=wall, evaluations=evaluations, work=work)

    def _integrate(self, times: Real, effort: Effort) -> tuple[list[Real], int, str]:
        """States at the sample times reached, evaluations of the right-hand side, and why it stopped early.

        It restarts wherever a function of time is not smooth, so that the error control never steps over a kink; the
        right-hand side sees the limit from the left at the end of a stretch.
        """
        ends = [times[0], *breaks_between(self._functions, times[0], times[-1]), times[-1]]
        y = self._dynamics.initial()
        states = [y]
        evaluations = 0
        for begin, end in pairwise(ends):
            before_end = np.nextafter(end, begin)
            inside = times[(times > begin) & (times <= end)]
            solved = solve_ivp(
                lambda t, y, last=before_end: self._dynamics.rate(min(t, last), y),
                (begin, end), y, method=effort.method, t_eval=np.union1d(inside, [end]),
                rtol=effort.value, atol=max(_SMALL * effort.value, _ROUND_OFF),
            )  # fmt: skip
            evaluations += solved.nfev
            good = np.isfinite(solved.y).all(axis=0)
            count = len(good) if good.all() else int(np.argmin(good))
            states += [solved.y[:, k] for k in range(count) if solved.t[k] in inside]
            if solved.status != 0 or count < len(good):
                stopped = solved.t[count - 1] if count else begin
                return states, evaluations, f"stopped after t = {stopped:g} s: {solved.message}"
            y = solved.y[:, -1]
        return states, evaluations, ""
