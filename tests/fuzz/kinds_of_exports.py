"""What `crosscheck export` writes and `python -m rebuild` reads: models, modes, references, error bars."""

import csv
import io
import json
from itertools import product
from pathlib import Path

import numpy as np

from crosscheck.export.archive import case_files
from crosscheck.export.rebuild import read_case
from crosscheck.export.rebuild.comparison import reference
from crosscheck.library.find import load_case
from tests.fuzz import mutate
from tests.fuzz.kind import Kind

CASES = Path(__file__).resolve().parents[2] / "cases"
FLEXIBLE, RIGID = "flexible_mechanisms/double_pendulum", ("wheels/spin_up", "spacecraft/slosh", "tops/free_body")
PLACES = ("exported", "exported_whole")  # the models that are read, and the case that stays whole but for one file


def of_exports(folder: Path) -> dict[str, Kind]:
    """Kinds by name; the exported case that the mutants are files of is put into `folder`."""
    files = {name: _short(text) for name, text in _files(FLEXIBLE).items() if name.endswith((".json", ".csv"))}
    for place, name in product(PLACES, files):
        (folder / place / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / place / name).write_bytes(files[name])
    models = (files["model.json"], *(_short(_files(case)["model.json"]) for case in RIGID))
    data = (*mutate.BYTES, mutate.string, mutate.nest, mutate.number, *[mutate.fields] * 6)
    table = (*mutate.TEXT, mutate.lines, *[mutate.cells] * 4)
    modes, refused, (several, whole) = "modal/upper.json", (SystemExit,), PLACES
    return {
        "exported model": Kind(f"{several}/model.json", models, data, refused, _model),
        "exported modes": Kind(f"{whole}/{modes}", (files[modes],), data, refused, _modes, f"{whole}/model.json"),
        "exported reference": Kind(f"{whole}/reference.csv", (files["reference.csv"],), table, refused, _values),
        "exported bars": Kind(f"{whole}/uncertainty.csv", (files["uncertainty.csv"],), table, refused, _bars),
    }


def _files(case: str) -> dict[str, str]:
    return case_files(load_case(CASES / case))[0]


def _short(text: str) -> bytes:
    """A table's first lines; data in one line, as mutations of fields take them."""
    if text.startswith("{"):
        return json.dumps(json.loads(text)).encode()
    return "".join(text.splitlines(keepends=True)[:30]).encode()


def _model(path: Path) -> str | None:
    case, said = read_case(path.parent), json.loads(path.read_bytes())
    masses = {body["name"]: body["mass_kg"] for body in said["bodies"] if "mass_kg" in body}
    if masses != {name: body["mass_kg"] for name, body in case.bodies.items() if "mass_kg" in body}:
        return "masses were taken as something else"
    if len(said["joints"]) != len(case.joints):
        return "joints were dropped"
    M, f = case.equations(0.0, case.start)
    return None if np.all(np.isfinite(M)) and np.all(np.isfinite(f)) else "a number is not finite"


def _modes(path: Path) -> str | None:
    taken, said = read_case(path.parents[1]).modal[path.stem], json.loads(path.read_bytes())
    for key, values in said["points"].items():
        if not np.array_equal(np.array(values, float), taken["points"][key]):
            return f"{key} was taken as something else"
    shapes = {key: np.shape(taken["points"][key])[1:] for key in ("position_m", "translation_modes")}
    return None if shapes == {"position_m": (3,), "translation_modes": (3, said["modes"])} else f"{shapes} were taken"


def _values(path: Path) -> str | None:
    times, channels, _ = reference(path.parent)
    head, *rows = _rows(path)
    names = [name.rpartition(" [")[0] for name in head]
    said = dict(zip(names, np.array(rows, float).T, strict=True))
    if not np.array_equal(said["t"], times) or 1 + sum(rows.shape[1] for rows in channels.values()) != len(said):
        return "times were changed, or columns dropped"
    for channel, taken in channels.items():
        places = [name for name in (channel, *(f"{channel}.{part}" for part in "wxyz")) if name in said]
        if not np.array_equal(np.column_stack([said[name] for name in places]), taken):
            return f"{channel} was taken as something else"
    return None


def _bars(path: Path) -> str | None:
    known = reference(path.parent)[2]
    said = {channel: float(bar) for channel, _, bar, *_ in _rows(path)[1:]}
    if said != known:
        return "error bars were changed"
    return None if all(0.0 <= bar < np.inf for bar in known.values()) else "an error bar is negative"


def _rows(path: Path) -> list[list[str]]:
    return list(csv.reader(io.StringIO(path.read_text(encoding="utf-8"))))
