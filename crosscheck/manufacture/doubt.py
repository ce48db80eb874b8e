"""The exact answers of a manufactured scene, and how far its own motion may be from them.

The scene as written leaves M delta udot = -d of the equations, d what its tables miss and the rounding of its loads. To
first order the motion is off by delta with

    M delta udot - J' delta lambda = -d - (dn/dq) delta q - (dn/du) delta u
                      J delta udot =    - (da/dq) delta q - (da/du) delta u,

n what the motion needs and a the accelerations of closures; the derivatives are differences, at a few times. d is
largest in the middle of an interval, and is taken to be that all along it. What channels make of delta q and delta u is
their difference at a state beside the exact one, times SAFETY.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from crosscheck.engines.contract import MarkerPath, Trajectory
from crosscheck.library.case_error import CaseError
from crosscheck.manufacture.drives import Manufactured, constraint_loads, constraint_rows
from crosscheck.manufacture.motion import DrawnState, tangent
from flexmb.dense import DenseSystem
from flexmb.dense.body_frames import Motions
from flexmb.dense.closures import open_loads, rows, through_hinges, wrenches
from flexmb.dense.connectors import hold
from flexmb.run.channels import channels_of, distance, family, magnitude
from flexmb.scene.connectors import AlongHinge
from flexmb.scene.quaternions import quaternion_of
from flexmb.typing import Real

PLACES = 3
"""Times at which the equations are linearised; each serves an equal part of the run."""
STEP = 1e-6
"""Of differences, in rad, m and modal coordinates."""
SAFETY = 3.0
"""Of the first-order estimate, as of a grid of unproved order: fast modes ring between the times it is known."""
LARGEST = 1e-5
"""Of the deviation of a displacement, rad, m or modal coordinate: a motion that is known no better is not known."""
ROUNDING = 64.0
"""Units in the last place of the largest channel of a family that summing a scene's points may leave."""
EPS = float(np.finfo(np.float64).eps)


def answers(made: Manufactured, times: Real) -> tuple[dict[str, Real], dict[str, float]]:
    """Channels (T,k) at `times` (T,) of the exact motion, and how far the scene's own may be from each of them.

    Loads that redundant closures leave open, and loads of couplings, are left out. CaseError for a motion so unstable
    that it is not known.
    """
    dense = made.dense
    exact = [made.motion.at(float(t)) for t in times]
    off, size = _deviations(made, times)
    worst = float(np.max(off[:, 0]))
    if not worst <= LARGEST:
        raise CaseError(
            f"this motion grows away from itself: it would be known to {worst:.1e} only; take a shorter --duration, or "
            "another --seed"
        )
    beside = [_moved(dense, state, change / size) for state, change in zip(exact, off, strict=True)]
    channels, moved = (_channels(dense, times, states) for states in (exact, beside))
    hidden = _open(made)
    largest: dict[str, float] = {}
    for name, values in channels.items():
        largest[family(name)] = max(largest.get(family(name), 0.0), magnitude(name, values))
    known = {
        name: SAFETY * size * float(np.max(distance(name, moved[name], values)))
        + ROUNDING * EPS * largest[family(name)]
        for name, values in channels.items() if name not in hidden
    }  # fmt: skip
    return {name: values for name, values in channels.items() if name in known}, known


def _channels(dense: DenseSystem, times: Real, states: list[DrawnState]) -> dict[str, Real]:
    """All channels of states, one at each of `times`, by the dense route."""
    found: dict[str, list[dict[str, Real]]] = {}
    for t, state in zip(times.tolist(), states, strict=True):
        for key, each in _instant(dense, t, state).items():
            found.setdefault(key, []).append(each)
    rows_of = {key: {name: np.array([x[name] for x in each]) for name in each[0]} for key, each in found.items()}
    paths = rows_of.pop("markers").items()
    markers = {name: MarkerPath(values[:, :3], values[:, 3:7], values[:, 7:]) for name, values in paths}
    momentum = rows_of.pop("momentum")["momentum"]
    return channels_of(Trajectory("finished", "", times, markers, momentum=momentum, **rows_of))  # type: ignore[arg-type]


def _instant(dense: DenseSystem, t: float, state: DrawnState) -> dict[str, dict[str, Real]]:
    q, u, rates = state
    held = [x for x in dense.tree.scalars if x.prescribed is not None]
    bound = held or dense.scene.constraints
    found = constraint_loads(dense, dense.needed(t, q, u, rates), q, held) if bound else np.zeros(0)
    count = len(found) - len(held)
    closures = {name: wrench @ found[: wrench.shape[1]] for name, wrench in wrenches(dense, q).items()}
    loads = dense.hinge_loads(t, q, u, rates)
    if closures:
        loads = {name: load + through_hinges(dense, q, closures)[name] for name, load in loads.items()} | closures
    drives: dict[str, Real] = {}
    for x, drive in zip(held, found[count:], strict=True):
        drives[x.owner] = np.append(drives.get(x.owner, np.zeros(0)), drive)
    along = [c for c in dense.scene.connectors if isinstance(c, AlongHinge)]
    masses = {mass.name for mass in dense.scene.point_masses}
    return {
        "markers": {
            name: np.concatenate([m.position, quaternion_of(m.rotation), m.velocity])
            for name, m in dense.markers(t, q, u, rates).items()
        },
        "loads": {name: load for name, load in loads.items() if name not in masses},
        "wheel_loads": dense.wheel_loads(t, q, u, rates),
        "drives": drives,
        "connectors": {name: gripped.on_b for name, gripped in dense.grips(q, u, t).items()},
        "hinge_forces": {c.name: np.array([hold(dense.scene, dense.tree, c, q, u, t).load]) for c in along},
        "energy": {kind: np.array(value) for kind, value in dense.energy(q, u).items()},
        "momentum": {"momentum": dense.momentum(q, u)},
    }


def _open(made: Manufactured) -> set[str]:
    """Channels that redundant closures leave open, by the state in the middle of the run."""
    dense = made.dense
    if not dense.scene.constraints:
        return set()
    held = np.zeros(dense.nu, dtype=bool)
    held[[x.u for x in dense.tree.scalars if x.prescribed is not None]] = True
    found = open_loads(dense, made.motion.at(0.5 * made.duration_s).q, held)
    hidden = {f"drive:{name}" for name, is_open in found.drives.items() if np.any(is_open)}
    for name, parts in found.loads.items():
        hidden |= {f"load:{name}.torque"} if np.any(parts[:3]) else set()
        hidden |= {f"load:{name}.force"} if np.any(parts[3:]) else set()
    return hidden


def _moved(dense: DenseSystem, state: DrawnState, change: Real) -> DrawnState:
    """The state with changes (3,nu) of displacement, speeds and their rates."""
    return DrawnState(state.q + tangent(dense, state.q, change[0]), state.u + change[1], state.rates + change[2])


def _deviations(made: Manufactured, times: Real) -> tuple[Real, float]:
    """Bounds (T,3,nu) on displacement, speeds and rates at `times`, and their size in units of STEP.

    The part by interpolation has its sign and its course; that by rounding is taken to push all the time.
    """
    h, n = made.interval_s, made.dense.nu
    count = len(made.between)
    places = [made.duration_s * (i + 0.5) / PLACES for i in range(PLACES)]
    models = [_linearised(made, t) for t in places]
    flows = [expm(h * np.block([[A, np.eye(2 * n)], [np.zeros((2 * n, 4 * n))]]))[: 2 * n] for A, _ in models]
    pushed, shaken = np.zeros((2, count + 1, 2 * n))
    rates = np.zeros((count + 1, n))
    for i in range(count):
        place = min(i * PLACES // count, PLACES - 1)
        (A, inverse), flow = models[place], flows[place]
        push, shake = (np.concatenate([np.zeros(n), x]) for x in (-inverse @ made.defect[i], inverse @ made.rounding))
        pushed[i + 1] = flow[:, : 2 * n] @ pushed[i] + flow[:, 2 * n :] @ push
        shaken[i + 1] = flow[:, : 2 * n] @ shaken[i] + flow[:, 2 * n :] @ shake
        rates[i + 1] = np.abs(A[n:] @ pushed[i + 1]) + np.abs(A[n:] @ shaken[i + 1]) + np.abs(shake[n:])
    at = np.rint(np.asarray(times) / h).astype(int)
    whole = np.abs(pushed) + np.abs(shaken)
    found = np.stack([whole[at, :n], whole[at, n:], rates[at]], axis=1)
    return found, max(float(np.max(found)), 1e-300) / STEP


def _linearised(made: Manufactured, t: float) -> tuple[Real, Real]:
    """A (2nu,2nu) of [displacement; speeds], and the accelerations (nu,nu) by unit generalised forces."""
    dense, state, n = made.dense, made.motion.at(t), made.dense.nu
    held = [x for x in dense.tree.scalars if x.prescribed is not None]
    free = np.ones(n, dtype=bool)
    free[[x.u for x in held]] = False
    J = constraint_rows(dense, state.q)
    loads = constraint_loads(dense, dense.needed(t, *state), state.q, held)[: len(J)]

    def left(other: DrawnState) -> Real:
        needed = dense.needed(t, *other) - constraint_rows(dense, other.q).T @ loads
        motion = Motions(other.q, other.u[None], other.rates[None])
        closing = [rows(dense, constraint, motion)[2, 0] for constraint in dense.scene.constraints]
        return np.concatenate([needed[free], *closing])

    here, by = left(state), np.zeros((2, n, np.count_nonzero(free) + len(J)))
    for kind in range(2):
        for i in np.flatnonzero(free):
            change = np.zeros((3, n))
            change[kind, i] = STEP
            by[kind, i] = (left(_moved(dense, state, change)) - here) / STEP
    M = dense.mass_matrix(state.q)[np.ix_(free, free)]
    whole = np.block([[M, -J[:, free].T], [J[:, free], np.zeros((len(J),) * 2)]])
    response = np.linalg.pinv(whole, rcond=1e-12)[: len(M)]
    A, inverse = np.zeros((2 * n, 2 * n)), np.zeros((n, n))
    A[:n, n:] = np.diag(free.astype(float))
    A[np.ix_(n + np.flatnonzero(free), np.arange(2 * n))] = -response @ np.concatenate(by).T
    inverse[np.ix_(free, free)] = response[:, : len(M)]
    return A, inverse
