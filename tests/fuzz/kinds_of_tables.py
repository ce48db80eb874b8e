"""What users write beside scenes and cases: measurements, expectations; baselines, scores; beams by special data."""

import csv
import io
import json
import math
import tomllib
import zipfile
from pathlib import Path

import msgspec
import numpy as np

from crosscheck.engines.fmu.archive import read_archive
from crosscheck.engines.fmu.bad import BadFmu
from crosscheck.engines.fmu.mapping import read_mapping
from crosscheck.library.case import CaseError
from crosscheck.library.expect_file import NAME, read_expect_file
from crosscheck.library.find import load_case
from crosscheck.library.with_claims import with_claims
from crosscheck.mutation.campaign import SCORES
from crosscheck.report.mutations import read_scores
from crosscheck.sealed.compare import compare_results
from crosscheck.sealed.seal import ResultsError, read_finished, sealed_text
from flexmb.run.stored import stored_columns
from flexmb.scene.bodies import BeamBody
from flexmb.scene.files import dumps, load_scene
from flexmb.scene.problems import SceneError
from flexmb.scene.rest_curve import is_curved, rest_sections
from flexmb.sensitivity.measurements import measurements
from tests.crosscheck.engines.fmu.foreign import MAPPING
from tests.crosscheck.sealed.test_compare import made
from tests.crosscheck.sessions import CASE
from tests.flexmb.scene.test_sections import K, M, scene, station
from tests.fuzz import mutate
from tests.fuzz.kind import Accept, Kind

CASES = Path(__file__).resolve().parents[2] / "cases"
MEASURED = b"t [s],tip.position.x [m],angle [rad],'=sum [1]\n0,0.5,0.1,1\n0.25,,0.2,2\n0.5,0.45,nan,3\n1,4e-1,0.3,-4\n"
STORED = b"t [s],pivot.rotation [rad],energy.total [J]\n0,0.5,1\n0.1,0.4,1.0\n0.2,-1e-3,nan\n"
EXPECTED = """[[goal]]
engine = "stepper"
cases = ["*"]
goals = { "*" = 1e-3, load = 1e-2 }
reason = "semi-implicit Euler is of first order"

[[expected_failure]]
engine = "biased"
channels = ["load"]
status = "differ"
reason = "its loads are without the torque"

[[efforts]]
engine = "stepper"
values = [1e-3, 5e-4]
"""
SCORED = {"cases": [{
    "case": "pendulum/single", "score": 0.5, "score_by_reference": 1.0,
    "mutants": [{"mutation": "mass", "target": "rod", "outcome": outcome, "reason": "it differs", "channels": {
        "energy.total": {"status": "differ", "E": 0.5, "U": 1e-9}}} for outcome in ("noticed", "missed", "not judged")],
    "passed_over": [{"mutation": "gravity", "target": "scene", "reason": "it has none"}],
}]}  # fmt: skip


def of_tables(read_scene: Accept) -> dict[str, Kind]:
    """Kinds by name; `read_scene` is how a scene is read and judged."""
    table = (*mutate.TEXT, mutate.lines, *[mutate.cells] * 4)
    sealed = (*mutate.BYTES, mutate.string, mutate.number, *[mutate.seal_anew] * 6)
    lines = (*mutate.BYTES, mutate.string, mutate.nest, *[mutate.fields] * 3)
    numbers = (*mutate.TOML, *[mutate.number] * 8)
    curved = tuple((CASES / "beams" / name / "scene.toml").read_bytes() for name in ("twisted", "coned_blade"))
    coupled = ((CASES / "closed_chains/geared_hoist/scene.toml").read_bytes(),)
    sections = (dumps(scene(station(0.0, K, M))).encode(),)
    beam = lambda path: read_scene(path) or _rest(path)  # noqa: E731
    return {
        "stored run": Kind("trajectory.csv", (STORED,), table, (ValueError,), _stored),
        "stored arrays": Kind("trajectory.npz", (_arrays(),), mutate.BYTES, (ValueError,), _stored),
        "mapping of an FMU": Kind("swing.toml", (MAPPING.encode(),), mutate.TOML, (BadFmu,), _mapping),
        "FMU": Kind("swing.fmu", (_fmu(),), mutate.BYTES, (BadFmu,), _archive),
        "measurements": Kind("ring.csv", (MEASURED,), table, (ValueError,), _measured),
        "expectations": Kind(NAME, (EXPECTED.encode(),), mutate.TOML, (CaseError,), _expected),
        "baseline": Kind("baseline.json", (sealed_text(made()).encode(),), sealed, (ResultsError,), _baseline),
        "scores": Kind(SCORES, (json.dumps(SCORED).encode(),), lines, (ValueError,), _scores),
        "curvature": Kind("scene.toml", curved, numbers, (SceneError,), beam, 'scene "'),
        "section matrices": Kind("scene.toml", sections, numbers, (SceneError,), beam, 'scene "'),
        "couplings": Kind("scene.toml", coupled, numbers, (SceneError,), read_scene, 'scene "'),
    }


def _arrays() -> bytes:
    memory = io.BytesIO()
    values = np.array([[0.0, 0.5], [0.1, 0.4]])
    np.savez(memory, names=np.array(["t", "pivot.rotation"]), units=np.array(["s", "rad"]), scene="p", values=values)
    return memory.getvalue()


def _fmu() -> bytes:
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w") as archive:
        archive.writestr("modelDescription.xml", '<fmiModelDescription fmiVersion="2.0" modelName="swing"/>')
    return memory.getvalue()


def _stored(path: Path) -> str | None:
    columns = stored_columns(path)
    lengths = {column.shape for column in columns.values()}
    return None if len(lengths) == 1 and "t" in columns else f"columns are of {lengths}"


def _mapping(path: Path) -> str | None:
    content = json.loads(msgspec.json.encode(read_mapping(path)))
    said = tomllib.loads(path.read_text(encoding="utf-8"))
    return None if said.keys() <= content.keys() else "a key was dropped"


def _archive(path: Path) -> str | None:
    try:
        read_archive(path)
    except ModuleNotFoundError:  # of FMPy, which reads what the file describes
        return None
    return "an FMU without an interface was taken"


def _measured(path: Path) -> str | None:
    found = measurements(path)
    head, *rows = [row for row in csv.reader(io.StringIO(path.read_text(encoding="utf-8-sig"))) if row]
    taken = np.column_stack([found.t, found.values])
    if taken.shape != (len(rows), len(head)):
        return f"{len(rows)} rows of {len(head)} cells were taken as {taken.shape}"
    time = next(i for i, cell in enumerate(head) if cell.strip().split(" [")[0] == "t")
    order = [time, *(i for i in range(len(head)) if i != time)]
    said = np.array([[float(row[i]) if row[i].strip() else math.nan for i in order] for row in rows])
    return None if np.array_equal(said, taken, equal_nan=True) else "numbers were changed"


def _expected(path: Path) -> str | None:
    content = json.loads(msgspec.json.encode(read_expect_file(path)))
    case = load_case(CASE)
    (claimed,) = with_claims((case,), path, asked=("stepper", "biased"))
    text = path.read_text(encoding="utf-8-sig")
    said = tomllib.loads(text)
    for key, entries in said.items():
        for entry, taken in zip(entries, content[key], strict=True):
            if any(taken.get(name) != value for name, value in entry.items()):
                return f"{key}: {entry!r:.100} was taken as {taken!r:.100}"
    sizes = [value for each in content["goal"] for value in each["goals"].values()]
    sizes += [value for each in content["efforts"] for value in each["values"]]
    if not all(0.0 < value < math.inf for value in sizes):
        return "a goal or an effort is not positive"
    if not all(each["reason"].strip() for each in (*content["goal"], *content["expected_failure"])):
        return "a claim has no reason"
    return None if claimed.name == case.name else "another case"


def _baseline(path: Path) -> str | None:
    found, old = read_finished(path), made()
    compare_results(found, old)
    return None if compare_results(found, found).regressed is False else "worse than itself"


def _scores(path: Path) -> str | None:
    found = read_scores(path.parent)
    if found.error:
        raise ValueError(found.error)
    if not path.is_file():
        raise ValueError(f"{path.name} is no file")
    said = json.loads(path.read_bytes())["cases"]
    if [each["case"] for each in said] != list(found.cases):
        return "cases were dropped"
    for each, taken in zip(said, found.cases.values(), strict=True):
        if taken.score != each["score"] or len(taken.mutations) != len(each["mutants"]) + len(each["passed_over"]):
            return f"{each['case']} was taken as something else"
        if taken.score is not None and not 0.0 <= taken.score <= 1.0:
            return f"a score of {taken.score}"
    return None


def _rest(path: Path) -> str | None:
    """The unloaded axis of the beams, which a run would compute first."""
    for body in load_scene(path).bodies:
        if isinstance(body, BeamBody) and is_curved(body):
            position, rotation = rest_sections(body, np.linspace(0.0, body.length_m, 3))
            if not (np.isfinite(position).all() and np.allclose(rotation @ rotation.swapaxes(1, 2), np.eye(3))):
                return "the unloaded axis is none"
    return None

