"""One scene compiled for MuJoCo: evaluate at t = 0, or integrate at a fixed step with any of its integrators."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from math import ceil

import mujoco
import numpy as np

from crosscheck.engines.contract import Effort, Run, Snapshot, Trajectory
from crosscheck.engines.functions_of_time import breaks_between, scene_functions
from crosscheck.engines.linear.outputs import outputs
from crosscheck.engines.links import Link, Scalar, links
from crosscheck.engines.mujoco.forces import Forces
from crosscheck.engines.mujoco.linear import linearised
from crosscheck.engines.mujoco.observer import MujocoObserver
from crosscheck.engines.mujoco.tree import (
    MujocoCoupling,
    build_tree,
    initial_state,
    joint_name,
    mujoco_closure,
)
from crosscheck.engines.trajectories import stack
from flexmb.scene.schema import Scene
from flexmb.scene.tree import coupled
from flexmb.typing import Real

_INTEGRATORS = {  # method of an effort: MuJoCo's constant, evaluations per step
    "RK4": (mujoco.mjtIntegrator.mjINT_RK4, 4),
    "Euler": (mujoco.mjtIntegrator.mjINT_EULER, 1),
    "implicit": (mujoco.mjtIntegrator.mjINT_IMPLICIT, 1),
    "implicitfast": (mujoco.mjtIntegrator.mjINT_IMPLICITFAST, 1),
}


class MujocoModel:
    def __init__(self, scene: Scene) -> None:
        chain = links(scene)
        closures = tuple(mujoco_closure(scene, chain, closure) for closure in scene.closures)
        gravity = np.array(scene.gravity_m_s2, dtype=float)
        self._tree = build_tree(chain, gravity, closures, _couplings(scene, chain))
        self._forces = Forces(self._tree, scene)
        self._observer = MujocoObserver(self._tree, self._forces, scene, closures)
        self._functions = scene_functions(scene)
        self._linear = linearised(self._tree, self._forces, scene)

    def warm_up(self) -> None:
        """Nothing is compiled; touch the code once so that first-call costs are not timed."""
        self.evaluate()

    def evaluate(self) -> Snapshot:
        self._forces.before_end = np.inf
        return self._observer.observe(self._initial())

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        integrator, stages = _INTEGRATORS[effort.method]
        self._tree.model.opt.integrator = integrator
        with _quiet():
            start = time.perf_counter()
            states, steps, message = self._integrate(run.times, effort.value)
            wall = time.perf_counter() - start
            self._forces.before_end = np.inf
            data = mujoco.MjData(self._tree.model)
            samples = []
            for t, (qpos, qvel) in zip(run.times, states, strict=False):
                data.time, data.qpos[:], data.qvel[:] = t, qpos, qvel
                samples.append(self._observer.observe(data))
            at = zip(run.times, states, strict=False)
            linear = self._linear
            matrices = () if linear is None else (linear.at(t, *state) for t, state in at)
            asked = outputs(run.linear if linear is not None else (), matrices)
        return stack(
            run.times, samples, message=message, wall_s=wall, evaluations=stages * steps, steps=steps, linear=asked
        )

    def _initial(self) -> mujoco.MjData:
        data = mujoco.MjData(self._tree.model)
        data.qpos[:], data.qvel[:] = initial_state(self._tree)
        return data

    def _integrate(self, times: Real, longest: float) -> tuple[list[tuple[Real, Real]], int, str]:
        """(qpos, qvel) at the sample times reached, steps made, and why it stopped early.

        Sample times and breaks of the functions of time divide the run into intervals of equal steps <= `longest`. At
        the start of each, prescribed coordinates are set to their functions, so that round-off does not accumulate.
        """
        model, data = self._tree.model, self._initial()
        wanted = set(times.tolist())
        ends = sorted(wanted | set(breaks_between(self._functions, times[0], times[-1])))
        states = [(data.qpos.copy(), data.qvel.copy())]
        total = 0
        with self._forces.active():
            for begin, end in pairwise(ends):
                # Round-off in a whole ratio must not cost another step.
                steps = max(1, ceil((end - begin) / longest * (1.0 - 1e-9)))
                model.opt.timestep = (end - begin) / steps
                data.time = begin
                self._forces.before_end = np.nextafter(end, begin)
                self._forces.follow(begin, data)
                mujoco.mj_step(model, data, steps)
                total += steps
                if _is_bad(data):
                    return states, total, f"stopped between t = {begin:g} s and {end:g} s: {_last_warning(data)}"
                if end in wanted:
                    states.append((data.qpos.copy(), data.qvel.copy()))
        return states, total, ""


def _couplings(scene: Scene, chain: tuple[Link, ...]) -> tuple[MujocoCoupling, ...]:
    """Couplings by the names of the joints that they relate."""
    couplings = []
    for coupling in scene.couplings:
        related, joints = coupled(scene, coupling), []
        for member in related:
            link = next(link for link in chain if link.kind == "body" and link.joint == member.hinge.name)
            scalars = [k for k, freedom in enumerate(link.freedoms) if isinstance(freedom, Scalar)]
            joints.append(joint_name(link, scalars[member.place]))
        factors = tuple(member.factor for member in related)
        couplings.append(MujocoCoupling(coupling.name, tuple(joints), factors, coupling.offset))
    return tuple(couplings)


def _is_bad(data: mujoco.MjData) -> bool:
    return not (np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()) or _bad_warnings(data) > 0


def _bad_warnings(data: mujoco.MjData) -> int:
    kinds = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
    return sum(data.warning[int(kind)].number for kind in kinds)


def _last_warning(data: mujoco.MjData) -> str:
    return "MuJoCo found huge or undefined numbers" if _bad_warnings(data) else "undefined numbers"


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep MuJoCo from writing a log file into the working directory; divergence is reported as a status."""
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(None)
