"""The kinds of files that the project reads: good ones to start from, the reader, and when an accept is wrong.

A kind is one entry of `kinds`. `accept` reads a file as its command does, returns None or why the acceptance is wrong,
and raises the kind's documented error where it refuses.
"""

import csv
import io
import json
import math
import re
import tomllib
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from crosscheck.library.case import CaseError
from crosscheck.library.find import load_case
from crosscheck.records.archive import read
from crosscheck.records.kinds import RunRecord
from crosscheck.records.machine import environment
from crosscheck.records.packing import Packed
from crosscheck.report import write_all
from crosscheck.running.execute import execute
from crosscheck.running.plan import plan
from crosscheck.stability import map_records as maps
from crosscheck.stability.boundary import MapVerdict
from crosscheck.stability.map import Axis
from crosscheck.stability.verdict_file import read_verdicts
from crosscheck.verify.columns import TimesError, VerifyError, read_columns
from flexmb.scene.check import check_scene
from flexmb.scene.files import dumps, load_scene, loads
from flexmb.scene.modal_data import modal_arrays
from flexmb.scene.problems import SceneError
from flexmb.scene.rounding import ROUNDING
from tests.crosscheck.sessions import CASE, PROVIDER
from tests.flexmb.scene.bad_scenes import satellite
from tests.fuzz import mutate
from tests.fuzz.kind import Kind
from tests.fuzz.kinds_of_exports import of_exports
from tests.fuzz.kinds_of_imports import of_imports
from tests.fuzz.kinds_of_sessions import of_sessions
from tests.fuzz.kinds_of_tables import of_tables

TIMES = np.linspace(0.0, 1.0, 6)
SHIPPED = Path(__file__).resolve().parents[2] / "cases"
ACCEPTED = b"""["rigid, all engines"]
"energy.total | fine (rigid) | stepper (rigid)" = { E = 3.0e-11 }
"marker:tip.position | fine (rigid) | stepper (rigid)" = { E = 1.2e-9, U = 4.5e-8 }
"""
CHANNELS = (
    "marker", "energy", "momentum", "load", "wheel_load", "connector", "hinge_force", "drive", "work", "derivatives",
    "frequencies", "known_to",
)  # fmt: skip


def kinds(folder: Path) -> dict[str, Kind]:
    """All kinds by name; `folder` receives what has to lie beside the mutants."""
    _prepare(folder)
    (folder / "run.toml").unlink()  # each mutant has a whole folder to itself but for what it mutates
    run, toml = (CASE / "run.toml").read_bytes(), mutate.TOML
    jsonl = (*mutate.BYTES, mutate.lines, mutate.string, mutate.nest, mutate.fields, mutate.fields, mutate.fields)
    shipped = (file.read_bytes() for file in sorted(SHIPPED.glob("*/*/run.toml")))
    runs = tuple(re.sub(rb'scene = "[^"]*"', b'scene = "scene.toml"', text) for text in shipped)
    grounds = tuple(file.read_bytes() for file in sorted(SHIPPED.glob("*/*/provenance.toml")))
    table = (*mutate.TEXT, mutate.cells, mutate.cells, mutate.cells, mutate.cells, mutate.cells)
    records = (*jsonl, mutate.arrays_of_records, mutate.arrays_of_records)
    archive = (*mutate.BYTES[:3], *[mutate.members] * 6)
    case = lambda path: _case(path.parent)  # noqa: E731
    return {
        "scene": Kind("scene.toml", _scenes(), toml, (SceneError,), _scene, 'scene "'),
        "run file": Kind("run.toml", (run, *runs), toml, (CaseError,), case),
        "provenance": Kind("provenance.toml", grounds, toml, (CaseError,), case),
        "accepted figures": Kind("accepted.toml", (ACCEPTED,), toml, (CaseError,), _accepted),
        "readme": Kind("README.md", ((CASE / "README.md").read_bytes(),), mutate.BYTES, (CaseError,), case),
        "verify csv": Kind("my.csv", (_csv(),), table, (VerifyError, TimesError), _csv_file),
        "trajectory csv": Kind("trajectory.csv", (_trajectory(),), table, (VerifyError, TimesError), _csv_file),
        "npz": Kind("panel.npz", _npz(), archive, (SceneError,), _modal, 'body "panel"'),
        "records": Kind("records.jsonl", (_records(),), records, (ValueError,), _session),
        "map records": Kind("map.jsonl", (_map(),), jsonl, (ValueError,), _cells),
        "map verdicts": Kind("maps.json", (_verdicts(),), jsonl, (ValueError,), _maps), **of_sessions(folder),
        **of_imports(folder), **of_exports(folder), **of_tables(_scene),
    }  # fmt: skip


def _prepare(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("scene.toml", "run.toml", "provenance.toml", "README.md"):
        (folder / name).write_bytes((CASE / name).read_bytes())


# Good files


def _scenes() -> tuple[bytes, ...]:
    shipped = [file.read_bytes() for file in sorted(SHIPPED.glob("*/*/scene.toml")) if file.stat().st_size < 20_000]
    return (dumps(satellite().scene()).encode(), (CASE / "scene.toml").read_bytes(), *shipped)


def _csv() -> bytes:
    return _table(["t", *(f"tip.p{letter}" for letter in "xyz"), *(f"elbow.t{letter}" for letter in "xyz")])


def _trajectory() -> bytes:
    torque = [f"elbow.torque.{letter} [N m]" for letter in "xyz"]
    return _table(["t [s]", *(f"tip.position.{letter} [m]" for letter in "xyz"), *torque, "energy.total [J]"])


def _table(names: list[str]) -> bytes:
    count = len(names) - 1.0
    rows = [",".join(f"{value:.17g}" for value in (t, *np.cos(t + np.arange(count)))) for t in TIMES]
    return "\n".join([",".join(names), *rows, ""]).encode()


def _npz() -> tuple[bytes, ...]:
    found = []
    for write in (np.savez, np.savez_compressed):
        stream = io.BytesIO()
        write(stream, **modal_arrays(satellite().scene().bodies[3]).given)
        found.append(stream.getvalue())
    return tuple(found)


def _records() -> bytes:
    case = load_case(CASE)
    case = replace(case, run=msgspec.structs.replace(case.run, samples=21))
    record, jobs = plan(case, (), PROVIDER)
    found: list[Any] = [environment(), record]
    for job in jobs:
        execute(job, lambda each: found.append(each) if isinstance(each, RunRecord) else None)
    return b"".join(msgspec.json.encode(each) + b"\n" for each in found)


def _map() -> bytes:
    axis = Axis("x", cells=4)
    cell = [
        maps.CellRecord(identity="abc", level=0, i=i, j=0, x=0.1 * i, y=0.5, status="measured", value=float(i))
        for i in range(4)
    ]
    head = maps.MapRecord(map="m", identity="abc", quantity="q", x=axis, y=axis)
    return b"".join(msgspec.json.encode(each) + b"\n" for each in (environment(), head, *cell))


def _verdicts() -> bytes:
    verdict = MapVerdict(
        map="m", title="A map", status="agree", distance=1, worst="", cells={"stable": 3}, depth=2, seconds=0.5,
        overlay="theory", source="a book",
    )  # fmt: skip
    return msgspec.json.encode([verdict])


# Readers, and when they should have refused


def _scene(path: Path) -> str | None:
    scene = load_scene(path)
    check_scene(scene)
    if loads(dumps(scene)) != scene:
        return "writing and reading changes the scene"
    data, value = _toml(path), msgspec.to_builtins(scene)
    return _differs(data, value) or _not_finite(value) or _unphysical(value)


def _case(folder: Path) -> str | None:
    for name in ("run.toml", "provenance.toml", "README.md", "scene.toml"):
        if not (folder / name).exists() and not (folder / name).is_symlink():
            (folder / name).write_bytes((CASE / name).read_bytes())
    case = load_case(folder)
    data = _toml(folder / "run.toml")
    value = msgspec.to_builtins(case.run)
    wrong = _differs(data, value) or _not_finite(value) or _unjudgeable(value)
    if case.provenance is None:
        return wrong or "the provenance is there and was not read"
    ground = _toml(folder / "provenance.toml")
    return wrong or _differs(ground, msgspec.to_builtins(case.provenance))


def _accepted(path: Path) -> str | None:
    wrong = _case(path.parent)
    value = msgspec.to_builtins(load_case(path.parent).accepted)
    for table in value.values():
        for place in table:
            channel, *sides = place.split(" | ")
            head = channel.partition(":")[0] if ":" in channel else channel.partition(".")[0]
            if len(sides) != 2 or head not in CHANNELS or not all(side.endswith(" (rigid)") for side in sides):
                wrong = wrong or f"{place!r} is the key of no verdict"
    negative = any(isinstance(leaf, int | float) and leaf < 0 for _, leaf in _leaves(value))
    return wrong or _differs(_toml(path), value) or _not_finite(value) or ("a figure is negative" if negative else None)


def _toml(path: Path) -> Any:
    return tomllib.loads(path.read_text(encoding="utf-8-sig"))


def _csv_file(path: Path) -> str | None:
    columns = read_columns(path, TIMES)
    head, *rows = csv.reader(io.StringIO(path.read_text(encoding="utf-8-sig")))
    names = [name.strip() for name in head]
    if len(set(filter(None, names))) < len(list(filter(None, names))):
        return "a column is doubled"
    rows = [row for row in rows if any(cell.strip() for cell in row)]
    table = np.array([[float(cell) if cell.strip() else math.nan for cell in row] for row in rows])
    if len(table) != len(TIMES) or np.max(np.abs(table[:, 0] - TIMES)) > 1e-9:
        return "the times are not those asked for"
    left_out = {name for name in names if name.rpartition(" [")[0] in columns.left_out}
    compared = (j for j in range(1, len(names)) if names[j] not in left_out)
    given = [table[:, j] for j in compared if not np.all(np.isnan(table[:, j]))]
    taken = [column for values in columns.channels.values() for column in values.T]
    if not np.all(np.isfinite(taken)):
        return "a cell is not a finite number"
    return None if sorted(map(tuple, given)) == sorted(map(tuple, taken)) else "not every column was taken"


def _modal(path: Path) -> str | None:
    scene = satellite().scene()
    panel = msgspec.structs.replace(scene.bodies[3], points=(), stiffness=(), file=str(path))
    check_scene(msgspec.structs.replace(scene, bodies=(*scene.bodies[:3], panel, *scene.bodies[4:])))
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
    if len(set(names)) < len(names) or not all(name.endswith(".npy") for name in names):
        return "a member is doubled or no array"
    taken = modal_arrays(panel).given
    with np.load(path, allow_pickle=False) as archive:
        for name in archive.files:
            values = archive[name]
            if values.dtype.kind not in "fiu":
                return f"{name} is of type {values.dtype}"
            if name not in taken or not np.array_equal(values, taken[name]) or not np.all(np.isfinite(values)):
                return f"{name} was taken as something else"
    return None


def _session(path: Path) -> str | None:
    records = read(path)
    wrong = _lines_differ(path, records)
    broken = any(not isinstance(record, msgspec.Struct) for record in records)
    for record in records:
        if isinstance(record, RunRecord):
            for name, packed in record.channels.items():
                wrong = wrong or _packed(name, packed)
    outcome, _ = write_all(path, path.parent / "out")
    if outcome.ok and (broken or not outcome.all):
        return "green, although lines are broken"
    return wrong


def _cells(path: Path) -> str | None:
    records = maps.read(path)
    maps.cells_of(records, "abc")
    return _lines_differ(path, records)


def _maps(path: Path) -> str | None:
    value = msgspec.to_builtins(read_verdicts(path))
    return _differs(json.loads(path.read_bytes()), value) or _not_finite(value)


def _lines_differ(path: Path, records: list[Any]) -> str | None:
    """Every line that was taken is in its record as it stands, with nothing dropped."""
    lines = [line for line in path.read_bytes().split(b"\n")[:-1]]
    if len(lines) != len(records):
        return f"{len(lines)} lines, {len(records)} records"
    for line, record in zip(lines, records, strict=True):
        if isinstance(record, msgspec.Struct):
            value = msgspec.to_builtins(record)
            if wrong := _differs(json.loads(line), value) or _not_finite(value):
                return wrong
    return None


def _packed(name: str, packed: Packed) -> str | None:
    import base64
    import zlib

    size = len(zlib.decompressobj().decompress(base64.b64decode(packed.data), 10**8))
    return None if size == 8 * math.prod(packed.shape) else f"{name}: {size} bytes for the shape {packed.shape}"


def _differs(data: Any, value: Any, place: str = "$") -> str | None:
    """Where what was read (plain) does not hold what the file says (plain): dropped, converted or cut."""
    if place.endswith(".file"):
        return None  # made absolute
    if isinstance(data, dict) and isinstance(value, dict):
        data = _with_ends(data)
        return next(
            (wrong for key in data if (wrong := f"{place}.{key} was dropped" if key not in value
                                       else _differs(data[key], value[key], f"{place}.{key}"))), None
        )  # fmt: skip
    if isinstance(data, list) and ".points[" in place and isinstance(value, list | tuple) and len(data) < len(value):
        value = value[: len(data)]  # of a drawing's point the last field may be left out
    if isinstance(data, list) and isinstance(value, list | tuple) and len(data) == len(value):
        pairs = enumerate(zip(data, value, strict=True))
        return next((wrong for i, (a, b) in pairs if (wrong := _differs(a, b, f"{place}[{i}]"))), None)
    number = isinstance(data, int | float) and isinstance(value, int | float)
    alike = type(data) is type(value) or (number and isinstance(data, bool) == isinstance(value, bool))
    equal = alike and (data == value or (number and float(data) == float(value)))
    return None if equal else f"{place}: {data!r:.60} was taken as {value!r:.60}"


def _with_ends(data: dict[str, Any]) -> dict[str, Any]:
    """A beam whose places within rounding of an end are that end, as scenes take them."""
    length, lists = data.get("length_m"), [key for key in ("stations", "tip_masses", "nodes") if key in data]

    def at_end(place: Any) -> Any:
        x = place.get("x_m")
        ends = [end for end in (0.0, length) if isinstance(x, float) and 0.0 < abs(x - end) <= ROUNDING * length]
        return {**place, "x_m": ends[0]} if ends else place

    return {**data, **{key: [at_end(each) for each in data[key]] for key in lists}} if length and lists else data


def _leaves(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for name, item in value.items():
            yield from _leaves(item, name)
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _leaves(item, key)
    else:
        yield key, value


def _not_finite(value: Any) -> str | None:
    bad = (f"{key} is {leaf}" for key, leaf in _leaves(value) if isinstance(leaf, float) and not math.isfinite(leaf))
    return next(bad, None)


def _unphysical(scene: Any) -> str | None:
    """What no scene may hold, said again in the fewest words."""
    for key, leaf in _leaves(scene):
        if key in ("mass_kg", "length_m", "axial_inertia_kg_m2") and leaf is not None and leaf < 0.0:
            return f"{key} is {leaf}"
    for collection in ("bodies", "hinges", "markers", "wheels"):
        names = [item["name"] for item in scene[collection]]
        if len(set(filter(None, names))) < len(list(filter(None, names))):
            return f"two {collection} have one name"
    bodies = {body["name"] for body in scene["bodies"]} | {"ground"}
    if any(hinge["child"] not in bodies or hinge["parent"] not in bodies for hinge in scene["hinges"]):
        return "a hinge has no body"
    return None


def _unjudgeable(run: Any) -> str | None:
    """What no run file may hold: nothing to compare by."""
    if not run["duration_s"] > 0 or not run["samples"] >= 2:
        return "no time to run"
    for item in (*run["comparison"], *run["control"]):
        if not all(value > 0 for value in (*item["goals"].values(), *item["scales"].values())):
            return "a goal or scale that is not positive"
    return None if all(item["limit"] > 0 for item in run["conservation"]) else "a limit that is not positive"


__all__ = ["Kind", "kinds"]
