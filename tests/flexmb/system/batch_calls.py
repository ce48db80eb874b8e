"""Public calls that take many copies at once, with everything that can be wrong with their arguments.

A copy that is not finite is no error: it fails alone, and has a status. Here that is raised as an ArithmeticError, by
functions that look at all rows; a copy that fails the others, or goes unnoticed, is an AssertionError, hence a fault.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import flexmb as fm
from tests.flexmb.system.argument_kinds import (
    COPIES,
    NO_NUMBER,
    RUN,
    SAMPLES,
    Calls,
    Variant,
    World,
    attributes,
    but_none,
    chosen,
    numbers,
    vectors,
)  # fmt: skip

THREADS = chosen("1", 1.0, 1j, True, 0, -1, np.nan, [1], plain=((None, 1), (np.int64(2), 1), (10**30, 1)))


def tables(v: np.ndarray) -> Iterator[Variant]:
    """Of a row (n,k) for each copy."""
    wrong = {
        "one copy's row": v[0], "3-D": v[None], "0-d": np.array(1.0), "scalar": 1.0, "None": None, "text": "1.0",
        "short rows": v[:, :-1], "long rows": np.hstack([v, v]), "very long rows": np.zeros((len(v), 10**5)),
        "fewer copies": v[:-1], "very many copies": np.zeros((10**5, v.shape[1])), "no copies": v[:0], "empty": [],
        "transposed": v.T, "complex": v + 0j, "objects": v.astype(object), "strings": v.astype(str),
        "booleans": v > 0.0, "ragged": [[1.0], [1.0, 2.0]], "huge integers": [[10**400] * v.shape[1]] * len(v),
        "masked": np.ma.array(v, mask=np.arange(v.size).reshape(v.shape) == 1),
    }  # fmt: skip
    for name, value in wrong.items():
        yield Variant(name, value)
    for bad in (np.nan, np.inf, -np.inf):
        for place in ((0, 0), (len(v) - 1, v.shape[1] - 1)):
            spoiled = v.copy()
            spoiled[place] = bad
            yield Variant(f"{bad} at {place}", spoiled)
    unaligned, read_only = np.zeros(8 * v.size + 1, np.uint8)[1:].view(float).reshape(v.shape), v.copy()
    unaligned[:], read_only.flags.writeable = v, False
    right = {
        "list": v.tolist(), "tuple of rows": tuple(v), "float32": v.astype(np.float32), "read-only": read_only,
        "strided": np.repeat(v, 2, axis=1)[:, ::2], "reversed": v[::-1].copy()[::-1], "swapped bytes": v.astype(">f8"),
        "unaligned": unaligned, "Fortran's order": np.asfortranarray(v), "long double": v.astype(np.longdouble),
    }  # fmt: skip
    for name, value in right.items():
        yield Variant(name, value, v)
    whole = np.arange(1, v.size + 1).reshape(v.shape)
    for dtype in (int, np.int8, np.uint64):
        yield Variant(f"{np.dtype(dtype)}", whole.astype(dtype), whole.astype(float))
    for name, value in {"huge": 1e308, "hugely negative": -1e308, "large": 1e150, "tiny": 1e-320}.items():
        yield Variant(name, np.full_like(v, value), open=True)
    yield Variant("negative", -v, open=True)


def coordinates(v: np.ndarray) -> Iterator[Variant]:
    """Of rows that begin with a quaternion."""
    yield from tables(v)
    for size in (0.0, 1e-170):
        lost = v.copy()
        lost[1, :4] *= size
        yield Variant(f"a quaternion times {size}", lost)


def times(_: Any) -> Iterator[Variant]:
    """Of one time for all copies, or one for each."""
    yield from (number for number in numbers(0.5) if not isinstance(number.value, np.ndarray | list))
    yield from vectors_or_one(np.linspace(0.25, 0.75, COPIES))


def vectors_or_one(v: np.ndarray) -> Iterator[Variant]:
    yield from (vector for vector in vectors(v) if vector.name != "scalar" and vector.value is not None)
    yield Variant("the same for each", np.full(len(v), 0.5), 0.5)


def lists(*wrong: Any, right: list[Any]) -> Callable[[Any], Iterator[Variant]]:
    """Of one system or scene for each copy."""
    nothing = (None, 5, "scene.toml", [], (), [None], [*right, None], right[0], np.zeros(3), np.zeros(0), fm.System)

    def variants(_: Any) -> Iterator[Variant]:
        for value in (*nothing, *wrong):
            yield Variant(repr(value)[:60], value)
        yield Variant("tuple", tuple(right), right)
        yield Variant("generator", (each for each in right), right)

    return variants


def evaluated(accelerations: Callable[..., Any]) -> Callable[..., np.ndarray]:
    """Accelerations of all copies, or an ArithmeticError for those that have none."""

    def function(q: Any, u: Any, t: Any, threads: Any) -> np.ndarray:
        found = accelerations(q, u, t, threads=threads)
        times = np.broadcast_to(np.asarray(t, float), len(found.status))
        judge(found.failed, found.accelerations, q, u, times[:, None])
        return found.accelerations

    return function


def finished(run: fm.BatchTrajectory, q: Any, u: Any) -> tuple[np.ndarray, ...]:
    """Of runs that all finished, or an ArithmeticError."""
    assert all(run.message(copy).startswith("stopped") for copy in run.failed)
    judge(run.failed, np.concatenate([run.q[:, -1], run.u[:, -1]], axis=1), q, u)
    return run.q, run.u


def judge(failed: np.ndarray, rows: np.ndarray, *given: Any) -> None:
    """Rows are NaN where a copy failed, and nowhere else; a copy that is given what is not finite fails alone."""
    lost = np.zeros(len(rows), bool)
    for each in given:
        lost |= ~np.isfinite(np.asarray(each, float)).all(axis=1)
    has_failed = np.isin(np.arange(len(rows)), failed)
    assert (np.isnan(rows).all(axis=1) == has_failed).all() and np.isfinite(rows[~has_failed]).all(), rows
    assert not lost.any() or (lost == has_failed).all(), (lost, failed)
    if has_failed.any():
        raise ArithmeticError(f"copies {failed} failed")


def of_batches(w: World) -> Calls:
    """All of them."""
    tree, chain, start, batch, found = w.tree, w.chain, w.chain.initial_state, w.batch, Calls()
    q, u = (np.repeat(each[None], COPIES, axis=0) for each in (w.state.q, w.state.u))
    q[:, 4:] *= np.array([[0.5], [1.0], [1.5]])
    scenes = [system.scene for system in batch.systems]
    state = {"q": q, "u": u}
    at = {**state, "t": 0.5, "threads": 1}
    of_copies: dict[str, Any] = {"q": coordinates, "u": tables, "t": times, "threads": THREADS}
    found.add("System.accelerations_batch", evaluated(tree.accelerations_batch), at, **of_copies)
    found.add("Batch.accelerations", evaluated(batch.accelerations), at, **of_copies)
    closed = {"q": np.array([start.q] * COPIES), "u": np.array([start.u] * COPIES), "t": 0.5, "threads": 1}
    found.add(
        "System.accelerations_batch, chain", evaluated(chain.accelerations_batch), closed,
        q=closing, u=closing, t=times, threads=THREADS,
    )  # fmt: skip
    others = [[*scenes, w.renamed.scene], [scenes[0], chain.scene], [chain.scene, scenes[0]], batch, [tree]]
    found.add(
        "compile_batch",
        fm.compile_batch,
        {"scenes": scenes},
        lambda it: it.accelerations(q, u).accelerations,
        scenes=lists(*others, right=scenes),
    )
    systems = list(batch.systems)
    found.add(
        "Batch",
        fm.Batch,
        {"systems": systems},
        lambda it: it.accelerations(q, u).accelerations,
        systems=lists([tree, w.renamed], [tree, chain], [chain, tree], scenes, batch, right=systems),
    )
    found.add("Batch.states", sound(batch.states), state, q=finite_tables, u=finite_tables)
    found.add("Batch.rows", lambda x: batch.rows("q", x), {"x": q}, x=finite_tables)
    which = chosen(None, "1", 1.0, True, -1, COPIES, 10**30, plain=((np.int64(1), 1), (np.uint8(2), 2)))
    found.add("Batch.system", lambda copy: batch.system(copy).scene.gravity_m_s2, {"copy": 1}, copy=which)
    found.add("Batch.system, of one", lambda copy: tree.batch.system(copy).nu, {"copy": 1},
              copy=chosen(None, "1", -1, 1.0))  # fmt: skip
    found.ask(batch, "initial_states")
    found.add("Batch.accelerations, as they are", lambda: batch.accelerations(q, u), {}, attributes)
    run = fm.simulate_batch(batch, 0.01, "rk4", step=1e-3, samples=3)
    found.add("BatchTrajectory, attributes", lambda: attributes(run))
    found.add("simulate_batch, as it is", lambda: fm.simulate_batch(batch, 0.01, "rk4", step=1e-3, samples=3), {},
              attributes)  # fmt: skip
    found.add("BatchTrajectory.message", lambda copy: len(run.message(copy)), {"copy": 1}, copy=which)

    def simulated(copies: Any, t_end: Any, method: Any, *, q: Any, u: Any, **settings: Any) -> tuple[np.ndarray, ...]:
        return finished(fm.simulate_batch(copies, t_end, method, q=q, u=u, **settings), q, u)

    one_for_all = chosen(
        None, 5, "scene.toml", [], w.scene, np.zeros(3), fm.System, [tree],
        plain=((tree.batch, tree), ([w.scene] * COPIES, tree), (tuple([w.scene] * COPIES), tree)),
    )  # fmt: skip
    settings = {"rtol": 1e-6, "atol": 1e-8, "samples": 3, "max_steps": 100}
    found.add(
        "simulate_batch",
        simulated,
        {"copies": tree, "t_end": 0.01, "method": "dop853", **state, "threads": 1, **settings},
        copies=one_for_all,
        method=chosen(None, "euler", 5, "rk4"),
        q=but_none(coordinates),
        u=but_none(tables),
        threads=THREADS,
        rtol=chosen(*NO_NUMBER, 0.0, -1e-3, 0.2, 1e-17, plain=((np.float64(1e-6), 1e-6),)),
        atol=chosen(*NO_NUMBER, 0.0, -1e-3),
        samples=SAMPLES,
        max_steps=chosen(None, "5", 0, -1, 1e3, 10**30, True, np.nan, plain=((np.int32(100), 100),)),
        **RUN,
    )
    steps = chosen(*NO_NUMBER, 0.0, -1.0, 1e-300, plain=((np.float64(1e-3), 1e-3),))
    found.add(
        "simulate_batch, in steps",
        lambda step, **given: simulated(batch, 0.01, "rk4", step=step, samples=3, **given),
        {"step": 1e-3, **state},
        step=steps,
        q=but_none(coordinates),
        u=but_none(tables),
    )
    for name, scarce in (("q", q), ("u", u)):
        found.add(
            f"simulate_batch, {name} alone",
            lambda rows, name=name: fm.simulate_batch(tree, 0.01, "rk4", step=1e-3, samples=2, **{name: rows}).q,
            {"rows": scarce},
            rows=chosen(5, "rows", scarce[0], scarce[:, :-1], scarce + 0j, [[1.0], [1.0, 2.0]], scarce[None]),
        )
    return found


def finite_tables(v: np.ndarray) -> Iterator[Variant]:
    """Without what is for each copy to refuse."""
    return (table for table in tables(v) if not table.name.startswith(("nan", "inf", "-inf")))


def closing(v: np.ndarray) -> Iterator[Variant]:
    """Of rows without those that open a closed chain."""
    return (table for table in tables(v) if table.plain is v or (table.plain is None and not table.open))


def sound(states: Callable[..., tuple[np.ndarray, np.ndarray]]) -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """With what kernels need of arrays."""

    def function(q: Any, u: Any) -> tuple[np.ndarray, np.ndarray]:
        found = states(q, u)
        assert all(each.flags.carray and each.dtype == float for each in found)
        return found

    return function
