"""Checks of an engine's answers against the contract, before they are recorded. An invalid answer is a failed run.

Every function returns the answer in our own plain types (float64 copies, short clean text), so that what an engine
changes later does not reach a record.
"""

from __future__ import annotations

import math
import numbers
import traceback
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np

from crosscheck.engines.contract import (
    ENERGIES,
    OUTPUTS,
    UNIT_ROUNDOFF,
    Effort,
    Engine,
    MarkerPath,
    Model,
    Precision,
    Status,
    Support,
    Trajectory,
)
from crosscheck.engines.extremes import fault as fault_of_extremes
from crosscheck.engines.extremes import has_extremes
from crosscheck.engines.linear.outputs import fault as fault_of_linear
from crosscheck.engines.linear.parts import DERIVATIVES, FREQUENCIES
from crosscheck.engines.openness import ALL, AXES, LOAD_PARTS, Openness
from crosscheck.engines.trajectories import first_samples
from flexmb.run.channels import channels_of
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.schema import Scene
from flexmb.typing import Real

RUNGS = 3
LONGEST_TEXT = 4000
LARGEST_COUNT = 2**63 - 1  # what a record can hold
UNIT = 8 * float(np.finfo(np.float32).eps)
"""How far from 1 the norm of a quaternion may be: the rounding of an engine in single precision; drift is more."""


class BrokenContract(ValueError):
    """An answer that the contract does not allow; the message says what was expected and what was found."""


def clean(text: str) -> str:
    """Text of limited length that can be encoded as UTF-8."""
    cut = text[:LONGEST_TEXT]
    more = f" ... ({len(text) - len(cut)} characters more)" if len(cut) < len(text) else ""
    return cut.encode("utf-8", "backslashreplace").decode() + more


def describe(error: BaseException) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    place = f" ({frames[-1].name}, {Path(frames[-1].filename).name} line {frames[-1].lineno})" if frames else ""
    try:
        text = str(error)
    except Exception:
        text = "its message cannot be read"
    if isinstance(error, BrokenContract):
        return clean(f"broke the contract: {text}")
    return clean(f"{type(error).__name__}: {text}{place}")


def checked_precision(engine: Engine) -> Precision:
    """The precision that an engine states, double if it states none; BrokenContract for another than there are."""
    stated = getattr(engine, "precision", "double")
    for known in UNIT_ROUNDOFF:
        if isinstance(stated, str) and stated == known:
            return known
    raise BrokenContract(f"precision is {clean(repr(stated))}: it is one of {', '.join(UNIT_ROUNDOFF)}")


def checked_version(answer: Any) -> str:
    """What `version` returned: text."""
    text = _text(answer, "version()")
    _require(bool(text.strip()), "version() is empty: name the version of the library")
    return text


def checked_support(answer: Any) -> Support:
    """What `supports` returned."""
    _instance(answer, Support, "supports()")
    _one_of(answer.kind, ("exact", "surrogate", "no"), "the kind of supports()")
    return Support(answer.kind, _text(answer.reason, "the reason of supports()"))


def checked_ladder(answer: Any) -> tuple[Effort, ...]:
    """What `efforts` returned: at least three, from coarse to fine for each method."""
    _require(isinstance(answer, tuple | list), f"efforts() is {_named(answer)}, not a tuple of efforts")
    ladder = tuple(_effort(effort, f"efforts()[{i}]") for i, effort in enumerate(answer))
    _require(len(ladder) >= RUNGS, f"efforts() has {len(ladder)} efforts: an uncertainty needs at least {RUNGS}")
    _require(len({effort.label for effort in ladder}) == len(ladder), "efforts() has the same effort twice")
    finest: dict[tuple[str, str], float] = {}
    for effort in ladder:
        before = finest.setdefault((effort.kind, effort.method), math.inf)
        _require(effort.value < before, f"efforts() are not from coarse to fine: {effort.label} comes after {before:g}")
        finest[effort.kind, effort.method] = effort.value
    return ladder


def checked_model(answer: Any) -> Model:
    """What `compile` returned."""
    _require(isinstance(answer, Model), f"compile() returned {_named(answer)}, which is no model")
    return answer


def checked_run(answer: Any, times: Real, scene: Scene) -> Trajectory:
    """What `simulate` returned for the sample times asked for; an unfinished run is cut to its finite samples."""
    _instance(answer, Trajectory, "simulate()")
    _one_of(answer.status, get_args(Status), "the status")
    finished, message = answer.status == "finished", _text(answer.message, "message")
    _require(finished or bool(message.strip()), f'a "{answer.status}" run says in its message when and why')
    count = _reached(answer.times, times, finished)
    known = _known(scene)
    run = Trajectory(
        status=answer.status,
        message=message,
        times=times[:count].copy(),
        markers={
            name: _path(path, f"markers[{name!r}]", count)
            for name, path in _named_by(answer.markers, "markers", _names(scene.markers))
        },
        **{name: _output(getattr(answer, name), name, count, known.get(name)) for name in OUTPUTS},
        wall_s=_number(answer.wall_s, "wall_s"),
        evaluations=_count(answer.evaluations, "evaluations"),
        steps=_count(answer.steps, "steps"),
        operations=_count(answer.operations, "operations"),
        undetermined=_undetermined(answer, scene),
        events=_events(answer.events),
    )
    wrong = fault_of_linear(run.derivatives, run.frequencies, run.known_to, scene)
    _require(not wrong, wrong)
    good = _finite_samples(run, finished)
    run = run if good == count else first_samples(run, good)
    for name, path in run.markers.items():
        defect = np.abs(np.linalg.norm(path.quaternion, axis=1) - 1.0)
        if np.any(defect > UNIT):
            at = int(np.argmax(defect))
            raise BrokenContract(
                f"markers[{name!r}].quaternion at t = {times[at]:g} s has norm {1.0 + defect[at]:.9g} or its inverse: "
                "rotations are unit quaternions"
            )
    return replace(run, envelope=_envelope(answer.envelope, run))


def _reached(answer: Any, times: Real, finished: bool) -> int:
    """The number of requested samples that were reached. A time summed from T intervals has at most T rounding
    errors."""
    _require(isinstance(answer, np.ndarray) and answer.ndim == 1, f"times is {_named(answer)} and not an array (T,)")
    taken = _array(answer, "times", len(answer))
    _require(len(taken) <= len(times), f"times has {len(taken)} samples, more than the {len(times)} asked for")
    off = ~(np.abs(taken - times[: len(taken)]) <= len(times) * np.finfo(float).eps * times[-1])
    if np.any(off):
        at = int(np.argmax(off))
        raise BrokenContract(f"times[{at}] is {taken[at]:.17g} s where {times[at]:.17g} s was asked for")
    if finished and len(taken) < len(times):
        end = f"at t = {taken[-1]:g} s" if len(taken) else "before its first sample"
        raise BrokenContract(f"ended {end} of {times[-1]:g} s and called it done")
    return len(taken)


def _path(answer: Any, where: str, count: int) -> MarkerPath:
    _instance(answer, MarkerPath, where)
    return MarkerPath(
        position=_array(answer.position, f"{where}.position", count, 3),
        quaternion=_array(answer.quaternion, f"{where}.quaternion", count, 4),
        velocity=_array(answer.velocity, f"{where}.velocity", count, 6),
    )


def _known(scene: Scene) -> dict[str, set[str]]:
    """For each output that is given by item, the names of the items that can have it."""
    hinges, wheels = _names(scene.hinges), _names(scene.wheels)
    return {
        "loads": hinges | _names(scene.constraints) | _names(scene.point_masses),
        "total_loads": _names(scene.total_loads),
        "wheel_loads": wheels,
        "drives": hinges | wheels | _names(scene.point_masses),
        "connectors": _names(connector for connector in scene.connectors if isinstance(connector, BetweenNodes)),
        "hinge_forces": _names(connector for connector in scene.connectors if not isinstance(connector, BetweenNodes)),
        "energy": set(ENERGIES),
        "derivatives": set(DERIVATIVES),
        "known_to": {*DERIVATIVES, FREQUENCIES},
    }


def _output(answer: Any, where: str, count: int, known: set[str] | None) -> Any:
    """An output of a run as plain arrays: by name if only `known` items can have it, else one array or None."""
    columns = OUTPUTS[where]
    if known is not None:
        named = _named_by(answer, where, known)
        return {name: _array(values, f"{where}[{name!r}]", count, *columns) for name, values in named}
    return None if answer is None else _array(answer, where, count, *columns)


def _named_by(answer: Any, where: str, known: set[str]) -> list[tuple[str, Any]]:
    """The items of a mapping all of whose keys must be known names."""
    _require(isinstance(answer, Mapping), f"{where} is {_named(answer)}, not a mapping")
    there = ", ".join(sorted(known)) or "none"
    for name in answer:
        _require(isinstance(name, str) and name in known, f"{where} has {name!r}, and the scene has {there}")
    return list(answer.items())


def _array(answer: Any, where: str, count: int, *width: int | None) -> Real:
    """A float64 copy of an array (count, *width) of real numbers; a width of None may be any."""
    plain = isinstance(answer, np.ndarray) and not isinstance(answer, np.ma.MaskedArray)
    _require(plain, f"{where} is {_named(answer)}, not an array")
    _require(answer.dtype.kind in "fiu", f"{where} is of dtype {answer.dtype}, not of real numbers")
    shape = (count, *(n if n is not None else answer.shape[-1] for n in width if answer.ndim))
    right = answer.shape == shape and 0 not in shape[1:]
    _require(right, f"{where} has shape {answer.shape}; {_shape(count, width)} was expected")
    return np.array(answer, dtype=np.float64, order="C", subok=False)


def _finite_samples(run: Trajectory, finished: bool) -> int:
    """The number of samples, from the first, in which everything is finite; in a finished run all must be."""
    count = len(run.times)
    for where, values in _signals(run):
        good = np.all(np.isfinite(values), axis=tuple(range(1, values.ndim)))
        first = int(np.argmin(np.append(good, False)))
        if finished and first < len(run.times):
            raise BrokenContract(f"{where} is not finite at t = {run.times[first]:g} s, and the status is finished")
        count = min(count, first)
    return count


def _undetermined(answer: Trajectory, scene: Scene) -> tuple[str, ...]:
    """The names of undetermined components, which must be of loads or drives of the run.

    Only redundant closures leave loads undetermined, so on a tree the claim itself is a breach: it would hide its
    author's numbers, and take those of all other engines out of the comparison.
    """
    _instance(answer.undetermined, tuple, "undetermined")
    there = {f"load:{name}.{part}": len(AXES) for name in answer.loads for part in LOAD_PARTS}
    there |= {f"total_load:{name}.{part}": len(AXES) for name in answer.total_loads for part in LOAD_PARTS}
    there |= {f"drive:{name}": values.shape[-1] for name, values in answer.drives.items() if np.ndim(values) == 2}
    for each in answer.undetermined:
        _require(
            isinstance(each, str) and _names_some(each, there),
            f"undetermined has {each!r:.80}: it names channels of loads and drives that the run has, or components of "
            'theirs: "load:pin.force", "load:pin.force[y, z]", "drive:arm[2]"',
        )
        _require(
            bool(scene.constraints),
            f"undetermined has {each!r:.80}: the scene has no closures or couplings: the motion determines its loads",
        )
    return Openness.of(answer.undetermined).names


def _names_some(name: str, widths: Mapping[str, int]) -> bool:
    """Whether it names a channel of so many columns, or some of them."""
    try:
        named = Openness.of((name,)).by_channel
    except ValueError:
        return False
    return all(
        channel in widths and (columns is ALL or max(columns) < widths[channel]) for channel, columns in named.items()
    )


def _events(answer: Any) -> tuple[tuple[str, float], ...]:
    """Names and times (s) of what happened in a run."""
    _instance(answer, tuple, "events")
    for pair in answer:
        right = isinstance(pair, tuple) and len(pair) == 2 and isinstance(pair[0], str)
        _require(right, f"events has {pair!r:.80}: it holds names with times")
    return tuple((clean(name), _instant(t)) for name, t in answer)


def _instant(t: Any) -> float:
    real = isinstance(t, numbers.Real) and not isinstance(t, bool) and math.isfinite(float(t))
    _require(real, f"events has the time {t!r:.40}, which is no finite number")
    return float(t)


def _envelope(answer: Any, run: Trajectory) -> dict[str, Real]:
    """The envelope of a finished run, which contains the samples of each of its channels."""
    channels, checked = channels_of(run) if run.status == "finished" else {}, {}
    is_open = Openness.of(run.undetermined)
    known = {name for name in channels if has_extremes(name) and name not in is_open}
    for name, rows in _named_by(answer, "envelope", known):
        where = f"envelope[{name!r}]"
        _require(isinstance(rows, np.ndarray) and rows.ndim == 2, f"{where} is {_named(rows)} and not an array (5, k)")
        checked[name] = _array(rows, where, len(rows), None)
        wrong = fault_of_extremes(name, checked[name], run.times, channels[name])
        _require(not wrong, f"{where} {wrong}")
    return checked


def _determined(run: Trajectory, output: str, name: str, values: Real) -> Real:
    """The columns of an output that the motion determines."""
    if not run.undetermined or output not in ("loads", "total_loads", "drives"):
        return values
    is_open = Openness.of(run.undetermined)
    if output == "drives":
        return values[:, ~is_open.flags(f"drive:{name}", values.shape[1])]
    flags = [is_open.flags(f"{output.removesuffix('s')}:{name}.{part}", len(AXES)) for part in LOAD_PARTS]
    return values[:, ~np.concatenate(flags)]


def _signals(run: Trajectory) -> Iterator[tuple[str, Real]]:
    for name, path in run.markers.items():
        for part in fields(path):
            yield f"markers[{name!r}].{part.name}", getattr(path, part.name)
    for output in OUTPUTS:
        signals = getattr(run, output)
        if output == "known_to":
            continue  # an engine may say that it does not know: infinity
        if isinstance(signals, dict):
            for name, values in signals.items():
                yield f"{output}[{name!r}]", _determined(run, output, name, values)
        elif signals is not None:
            yield output, signals


def _effort(answer: Any, where: str) -> Effort:
    _instance(answer, Effort, where)
    _one_of(answer.kind, ("tolerance", "step"), f"{where}.kind")
    method = _text(answer.method, f"{where}.method")
    value = _number(answer.value, f"{where}.value")
    _require(value > 0.0, f"{where}.value is {value:g}: a tolerance or a step (s) is positive")
    return Effort(answer.kind, value, method)


def _one_of(answer: Any, words: tuple[str, ...], where: str) -> None:
    right = isinstance(answer, str) and answer in words
    _require(right, f"{where} is {answer!r:.80}: it is one of {', '.join(words)}")


def _text(answer: Any, where: str) -> str:
    _require(isinstance(answer, str), f"{where} is {_named(answer)}, not text")
    return clean(answer)


def _number(answer: Any, where: str) -> float:
    is_number = isinstance(answer, numbers.Real) and not isinstance(answer, bool)
    _require(is_number, f"{where} is {_named(answer)}, not a number")
    value = float(answer)
    _require(math.isfinite(value) and value >= 0.0, f"{where} is {value:g}: a finite number from 0 is expected")
    return value


def _count(answer: Any, where: str) -> int:
    whole = isinstance(answer, numbers.Integral) and not isinstance(answer, bool)
    _require(whole and 0 <= answer <= LARGEST_COUNT, f"{where} is {answer!r:.40}: a whole number from 0 is expected")
    return int(answer)


def _instance(answer: Any, kind: type, where: str) -> None:
    _require(isinstance(answer, kind), f"{where} returned {_named(answer)}, not a {kind.__name__}")


def _named(answer: Any) -> str:
    return "None" if answer is None else f"a {type(answer).__name__}"


def _names(items: Iterable[Any]) -> set[str]:
    return {item.name for item in items}


def _shape(count: int, width: tuple[int | None, ...]) -> str:
    return f"({', '.join('n' if n is None else str(n) for n in (count, *width))}{',' if not width else ''})"


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise BrokenContract(message)
