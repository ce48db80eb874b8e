"""What sessions and runs leave behind and take up: sealed results, sweeps, references, restarts."""

import csv
import hashlib
import io
import json
import re
from pathlib import Path

import msgspec
import numpy as np
from rich.console import Console

import flexmb as fm
from crosscheck.library.case import CaseError
from crosscheck.library.reference import digest, load_reference
from crosscheck.report.maps import MapShown, read_maps
from crosscheck.sampling.run import run_sweep
from crosscheck.sealed.compare import compare_results
from crosscheck.sealed.seal import ResultsError, read_results, sealed_text
from crosscheck.terminal.text import Verbosity
from crosscheck.terminal.verdicts import print_differences
from crosscheck.validation.measured_set import read_set
from flexmb.scene.reading import Unreadable, read_text
from tests.crosscheck.sealed.test_compare import made
from tests.crosscheck.sessions import CASE, PROVIDER
from tests.fuzz import mutate
from tests.fuzz.kind import Kind

SHIPPED = Path(__file__).resolve().parents[2] / "cases"
SWEEP = """title = "Where the rod is"
scene = "swept.toml"
duration_s = 1.0
samples = 11
engines = ["fine"]
efforts = [{ engine = "fine", kind = "tolerance", method = "dop853", value = 1e-8 }]
number = 6
seed = 3
"""
PARAMETERS = (
    'path = "hinges.pivot.rotation.angle_rad"\ndistribution = "normal"\nmean = 0.5\nsd = 0.1\n',
    'path = ["bodies.rod.mass_kg"]\nrelative = true\ndistribution = "uniform"\nlow = 0.9\nhigh = 1.1\n',
    'name = "angle"\npath = "pivot.rotation.angle_rad"\ndistribution = "triangular"\nlow = 0.1\nmode = 0.2\nhigh = 1\n',
    'path = "bodies.*.mass_kg"\ndistribution = "lognormal"\nmedian = 1.0\nsigma = 0.2\n',
    'path = "rod.mass_kg"\ndistribution = "values"\nvalues = [1.0, 2.5, 4.0]\n',
)
QUANTITIES = """
[[quantity]]
name = "height"
channel = "marker:tip.position"
component = "y"
value = "initial"

[[quantity]]
name = "energy"
channel = "energy.total"
value = "range"
"""


def of_sessions(folder: Path) -> dict[str, Kind]:
    """Kinds by name; what lies beside the mutants is put into `folder`."""
    (folder / "swept.toml").write_bytes((CASE / "scene.toml").read_bytes())
    results = sealed_text(made()).encode()
    (folder / "old.json").write_bytes(results)
    values, knowledge = _reference()
    for name, content in (("reference.csv", values), ("reference.toml", knowledge)):
        (folder / name).write_bytes(content)
    sets = [file.read_bytes() for file in sorted(SHIPPED.glob("measured/*/measured.toml"))]
    points = [file.with_name("points.csv").read_bytes() for file in sorted(SHIPPED.glob("measured/*/measured.toml"))]
    sealed = (*mutate.BYTES, mutate.string, mutate.number, *[mutate.seal_anew] * 6)
    table = (*mutate.TEXT, mutate.lines, *[mutate.cells] * 4)
    archive = (*mutate.BYTES[:3], *[mutate.members] * 6)
    words = (*mutate.BYTES, mutate.string, mutate.number)
    return {
        "results": Kind("results.json", (results,), sealed, (ResultsError,), _results),
        "sweep": Kind("sweep.toml", _sweeps(), mutate.TOML, (CaseError,), _sweep),
        "reference": Kind("reference.csv", (values,), table, (CaseError,), _values),
        "knowledge": Kind("reference.toml", (knowledge,), mutate.TOML, (CaseError,), _knowledge, "reference.csv"),
        "measured set": Kind("measured.toml", tuple(sets), mutate.TOML, (CaseError,), _measured),
        "measured points": Kind("points.csv", tuple(points), table, (CaseError,), _points),
        "restart": Kind("restart.npz", _restarts(folder), archive, (ValueError,), _restart),
        "maps": Kind("maps.json", _map_files(folder), words, (ValueError,), _maps),
    }


def _sweeps() -> tuple[bytes, ...]:
    found = [f"{SWEEP}\n[[parameter]]\n{parameter}{QUANTITIES}".encode() for parameter in PARAMETERS]
    grid = f"{SWEEP}\n[[parameter]]\n{PARAMETERS[-1]}{QUANTITIES}".replace("number = 6", 'sampling = "grid"')
    return (*found, grid.encode(), found[0].replace(b"seed = 3", b'sampling = "latin_hypercube"'))


def _reference() -> tuple[bytes, bytes]:
    """The smallest reference that is shipped, its CSV cut to a few lines and sealed again."""
    file = min(SHIPPED.glob("*/*/reference.csv"), key=lambda each: each.stat().st_size)
    values = b"".join(file.read_bytes().splitlines(keepends=True)[:8])
    knowledge = file.with_suffix(".toml").read_text(encoding="utf-8")
    return values, knowledge.replace(digest(file.read_text(encoding="utf-8")), digest(values.decode())).encode()


def _restarts(folder: Path) -> tuple[bytes, ...]:
    builder = fm.SceneBuilder("pendulum", gravity=(0.0, -9.81, 0.0))
    builder.rigid_body("rod", mass=1.0, com=(0.5, 0.0, 0.0), inertia=(0.01, 0.1, 0.1))
    plain = builder.revolute("pivot", "ground", "rod", axis=(0, 0, 1), angle=0.3).scene()
    falls = fm.SceneEvent(
        name="falls", watch="pivot.rotation", level=0.29, actions=(fm.Latch(coordinate="pivot.rotation"),)
    )
    found = []
    eventful = msgspec.structs.replace(plain, events=(falls,))
    for scene, method, step in ((plain, "dop853", None), (plain, "rk4", 0.01), (eventful, "dop853", None)):
        run = fm.simulate(scene, 0.1, method, step=step, samples=3)  # type: ignore[arg-type]
        assert run.restart is not None
        run.restart.save(folder / "seed.npz")
        found.append((folder / "seed.npz").read_bytes())
    (folder / "seed.npz").unlink()
    return tuple(found)


def _map_files(folder: Path) -> tuple[bytes, ...]:
    """What `crosscheck stability` leaves of two maps, one of which has a picture."""
    (folder / "growth.svg").write_text("<svg/>")
    shown = [
        MapShown(map=name, title="Growth", status="agree", worst="1e-6", cells={"agree": 9}, overlay="poles", source="")
        for name in ("growth", "decay")
    ]
    return (msgspec.json.encode(shown),)


def _maps(path: Path) -> str | None:
    """A report says why maps cannot be read, and is written without them."""
    found = read_maps(path.parent)
    if found.error:
        raise ValueError(found.error)
    said = [each["map"] for each in json.loads(path.read_bytes())]
    return None if said == [each.map for each in found.maps] else "other maps than the file has"


def _results(path: Path) -> str | None:
    found = read_results(path)
    text = path.read_bytes()
    if sealed_text(found).encode() != text and not _says(json.loads(text), found):
        return "it was read as something else"
    old = read_results(path.with_name("old.json"))
    print_differences(Console(file=io.StringIO()), compare_results(old, found), Verbosity.VERBOSE)
    print_differences(Console(file=io.StringIO()), compare_results(found, old), Verbosity.VERBOSE)
    return None


def _says(content: dict[str, object], found: object) -> bool:
    """Whether the file says what was read from it; defaults that stand in it count as left out."""
    return msgspec.convert({key: value for key, value in content.items() if key != "sha256"}, type(found)) == found


def _sweep(path: Path) -> str | None:
    done = run_sweep(path, path.parent / "out", fresh=True, provider=PROVIDER, scheduler=lambda *_: (_ for _ in ()))
    sweep = done.sweep
    if not done.records or not all(np.isfinite(list(record.parameters.values())).all() for record in done.records):
        return "no samples, or values that are not finite"
    grid = 1
    for parameter in sweep.parameters:
        grid *= len(getattr(parameter, "values", ()))
    count = grid if sweep.sampling == "grid" else sweep.number
    found = len(done.records)
    return None if found == count * len(sweep.engines) else f"{found} samples, and {count} were asked for"


def _text(path: Path) -> str:
    """What a regular file says; "" for what cannot be read."""
    try:
        return read_text(path)
    except (OSError, Unreadable):
        return ""


def _measured(path: Path) -> str | None:
    """The mutant beside readings of every series that it names; no number of it may be other than its checks say."""
    beside = path.with_name("points.csv")
    text, rows = _text(path), io.StringIO(newline="")
    names = re.findall(r'\[\[series\]\]\s*\nname = "([^"\n]*)"', text)
    drawn_by = re.findall(r'"([^"\n]*)"', " ".join(re.findall(r"^(?:over|by) = (.*)", text, re.MULTILINE)))
    conditions = sorted(set(drawn_by) - {"series", "measured"})
    among = re.findall(r"^among = \[([\d.]+)", text, re.MULTILINE)  # a reading there identifies, one elsewhere does not
    at = [(name, 1.0, *([value] * len(conditions))) for name in names for value in ("0", "1", *among)]
    csv.writer(rows).writerows([("series", "measured", *conditions), *at])
    beside.write_text(rows.getvalue(), encoding="utf-8", newline="")
    try:
        known = read_set(path.parent)
    finally:
        beside.unlink()
    numbers = [x for given in known.content.inputs for x in (given.value, given.deviation)]
    numbers += [known.deviation(point) for point in known.points]
    return None if np.all(np.isfinite(numbers)) else "a number that is not finite was accepted"


def _points(path: Path) -> str | None:
    """The mutant beside the file of the set whose series it names first."""
    text = _text(path)
    files = sorted(SHIPPED.glob("measured/*/measured.toml"))
    known = {file: re.findall(r'\[\[series\]\]\nname = "([^"]*)"', file.read_text(encoding="utf-8")) for file in files}
    most = max(files, key=lambda file: sum(text.count(f"\n{name},") + text.count(f'"{name}",') for name in known[file]))
    beside = path.with_name("measured.toml")
    beside.write_bytes(most.read_bytes())
    try:
        read = read_set(path.parent)
    finally:
        beside.unlink()
    lines = sum(bool(line.strip()) for line in text.splitlines()) - 1
    finite = all(np.isfinite([point.measured, *point.conditions.values()]).all() for point in read.points)
    return None if finite and len(read.points) <= lines else "a reading was made up, or is not finite"


def _values(path: Path) -> str | None:
    """The mutant with a seal that fits it, so that what it says is judged."""
    beside = path.with_name("reference.toml")
    if not path.is_file():  # no file to seal
        load_reference(path.parent)
    before = beside.read_text(encoding="utf-8")
    try:
        text = path.read_text(encoding="utf-8-sig")
        old = _sealed_in(before)
        beside.write_text(before.replace(old, digest(text)), encoding="utf-8")
        found = load_reference(path.parent)
    except UnicodeDecodeError:
        load_reference(path.parent)
        return "it is not UTF-8"
    finally:
        beside.write_text(before, encoding="utf-8")
    rows = [[float(cell.strip('"')) for cell in line.split(",")] for line in text.splitlines()[1:] if line]
    taken = np.column_stack([found.times, *found.channels.values()])
    return None if np.array_equal(np.array(rows), taken) and np.all(np.isfinite(taken)) else "numbers were changed"


def _sealed_in(knowledge: str) -> str:
    """The digest in reference.toml."""
    return next(line.split('"')[1] for line in knowledge.splitlines() if line.startswith("values"))


def _knowledge(path: Path) -> str | None:
    found = load_reference(path.parent)
    own = hashlib.sha256(path.with_name("reference.csv").read_bytes()).hexdigest()
    return None if found.knowledge.values == own else "another table is meant"


def _restart(path: Path) -> str | None:
    found = fm.Restart.load(path)
    with np.load(path, allow_pickle=False) as archive:
        for name in ("numbers", "y", "rows"):
            if not np.array_equal(archive[name], getattr(found.memory, name), equal_nan=True):
                return f"{name} was taken as something else"
    try:
        step = 0.01 if found.method == "rk4" else None
        run = fm.simulate(found.scene, found.t + 0.05, found.method, state=found, samples=2, step=step)
    except (ValueError, TypeError, ArithmeticError) as error:
        raise ValueError(f"{path.name}: {error}") from None
    return "a number is not finite" if run.finished and not np.all(np.isfinite(run.q)) else None
