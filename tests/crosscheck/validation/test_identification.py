"""Inputs identified by a part of the readings, on manufactured data: recovery, coverage, horizon, what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crosscheck.library.case_error import CaseError
from crosscheck.report.measured import write_measured
from crosscheck.validation.budget import budget, document
from crosscheck.validation.identification import identified
from crosscheck.validation.measured_set import MeasuredSet, Reading, read_set
from tests.crosscheck.validation.test_budget import HEAD

NOISE, TRUE = 0.01, {"size": 1.2, "decay": 0.15, "frequency": 2.1, "shift": 0.02}
TIMES = np.linspace(0.1, 8.0, 40)
FILE = (
    HEAD
    + """
fit = ["size", "decay", "frequency"]

[split]
condition = "t"
to = 4.0
horizon = "t"
"""
    + "".join(
        f"""
[[inputs]]
name = "{name}"
value = {value}
width = {width}
stated = false
why = "so"
"""
        for name, value, width in (
            ("size", 1.0, 0.2), ("decay", 0.1, 0.1), ("frequency", 2.0, 0.1), ("shift", 0.0, 0.02)
        )
    )
    + f"""
[[series]]
name = "swing"
what = "a number"
unit = "m"
over = "t"
reading = {NOISE}
stated = true
why = "so"
size = 1.0
expect = "validated"
within = 0.03
horizon = [6.0, 8.0]
"""
)  # fmt: skip
MODEL = """
from math import cos, exp, sin

def predict(points, inputs, effort):
    a, c, w, b = inputs.values()
    return [a * exp(-c * p.conditions["t"]) * cos(w * p.conditions["t"]) + b for p in points]
"""
EXACT = """
def derivatives(points, inputs, effort):
    a, c, w, b = inputs.values()
    found = {"size": [], "decay": [], "frequency": []}
    for p in points:
        t = p.conditions["t"]
        found["size"].append(exp(-c * t) * cos(w * t))
        found["decay"].append(-t * a * exp(-c * t) * cos(w * t))
        found["frequency"].append(-t * a * exp(-c * t) * sin(w * t))
    return found
"""
WRONG = MODEL.replace("cos(w *", 'cos(w * (1.0 + 0.02 * p.conditions["t"]) *')


def made(folder: Path, seed: int = 0, model: str = MODEL + EXACT, file: str = FILE) -> Path:
    """Readings of the true motion with noise of the declared size; the input without fit is drawn from its prior."""
    drawn = np.random.default_rng(seed)
    shift = 0.02 * drawn.normal()
    t = TIMES
    values = TRUE["size"] * np.exp(-TRUE["decay"] * t) * np.cos(TRUE["frequency"] * t) + shift
    values = values + NOISE * drawn.normal(size=len(t))
    rows = "".join(f"swing,{at:.17g},{value:.17g}\n" for at, value in zip(t, values, strict=True))
    for name, text in {"measured.toml": file, "points.csv": "series,t,measured\n" + rows, "model.py": model}.items():
        (folder / name).write_text(text)
    return folder


def drawn_anew(known: MeasuredSet, seed: int) -> MeasuredSet:
    """The same set with other noise, without its files."""
    drawn = np.random.default_rng(seed)
    shift = 0.02 * drawn.normal()
    points = tuple(
        Reading(
            point.series, point.conditions,
            TRUE["size"] * float(np.exp(-TRUE["decay"] * t) * np.cos(TRUE["frequency"] * t))
            + shift + NOISE * drawn.normal(),
        )
        for point in known.points
        for t in [point.conditions["t"]]
    )  # fmt: skip
    return replace(known, points=points)


def test_what_was_put_in_is_found_and_what_is_left_is_predicted(tmp_path: Path) -> None:
    """Half of the readings are predicted, at the inputs as found; the page says so."""
    known = budget(read_set(made(tmp_path)))
    assert known.identified is not None and known.identified.readings == 20 and len(known.of.points) == 20
    assert 0.6 < known.identified.misfit < 1.3
    (verdict,) = known.verdicts()
    assert verdict.ok and verdict.horizon == 8.0
    for given in known.of.content.inputs[:3]:
        assert abs(given.value - TRUE[given.name]) < 4.0 * given.deviation < 0.2
    index = write_measured([known], "one set", tmp_path / "out")
    page = next(file for file in index.parent.glob("*.html") if file != index).read_text(encoding="utf-8")
    assert "size, decay, frequency were identified by 20 other readings" in page and "Horizon, t" in page
    assert document(known)["identified"]["readings"] == 20


def test_the_covariance_is_that_of_a_linear_problem(tmp_path: Path) -> None:
    """A line, whose posterior covariance has a closed form: s^2 (X' X)^-1."""
    line = MODEL.replace("a * exp(-c * p", "a + c * (p").replace(' * cos(w * p.conditions["t"]) + b', "")
    file = FILE.replace('fit = ["size", "decay", "frequency"]', 'fit = ["size", "decay"]')
    known = identified(read_set(made(tmp_path, model=line, file=file)))
    early = TIMES[TIMES <= 4.0]
    X = np.column_stack([np.ones(len(early)), early])
    exact = NOISE**2 * np.linalg.inv(X.T @ X)
    spread = np.array([given.deviation for given in known.of.content.inputs[:2]])
    np.testing.assert_allclose(known.correlation[:2, :2] * np.outer(spread, spread), exact, rtol=1e-6)
    assert known.of.content.inputs[3].deviation == pytest.approx(0.02, rel=1e-6)  # nothing is learnt of it


def test_coverage_over_a_hundred_seeds(tmp_path: Path) -> None:
    """Inputs within two of their deviations, and predictions within 2 u_val, in 90 to 99 of 100; and samples agree."""
    known = read_set(made(tmp_path))
    inside, found, misfits = [], [], []
    for seed in range(100):
        tried = budget(drawn_anew(known, seed))
        assert tried.identified is not None
        inside.append(np.mean(tried.within))
        misfits.append(tried.identified.misfit**2)
        found.append([abs(g.value - TRUE[g.name]) <= 2.0 * g.deviation for g in tried.of.content.inputs[:3]])
    assert 0.90 <= np.mean(inside) <= 0.99
    assert np.all((np.mean(found, axis=0) >= 0.90) & (np.mean(found, axis=0) <= 0.99))
    assert np.mean(misfits) == pytest.approx(16.0 / 20.0, abs=0.1)  # four of twenty degrees of freedom are taken
    drawn = budget(drawn_anew(known, 3), samples=1000)
    assert drawn.sampled is not None
    np.testing.assert_allclose(drawn.sampled, drawn.u_input, rtol=0.15)


def test_exact_derivatives_and_differences_identify_the_same(tmp_path: Path) -> None:
    """Either way."""
    by = [identified(read_set(made(tmp_path, model=model))) for model in (MODEL + EXACT, MODEL)]
    for one, other in zip(by[0].of.content.inputs, by[1].of.content.inputs, strict=True):
        assert one.value == pytest.approx(other.value, abs=0.01 * one.deviation)
        assert one.deviation == pytest.approx(other.deviation, rel=0.01)


def test_a_wrong_model_leaves_its_band(tmp_path: Path) -> None:
    """A frequency that drifts fits the beginning, and not what follows: the horizon is short, and the file is held."""
    known = budget(read_set(made(tmp_path, model=WRONG)))
    (verdict,) = known.verdicts()
    assert verdict.standing == "model error" and not verdict.ok
    assert verdict.horizon is not None and verdict.horizon < 5.5
    assert not np.all(known.within)


@pytest.mark.parametrize(
    ("bounds", "word"), [("[6.0, 7.0]", "leaves its band after 8"), ("[3.0, 9.0]", "would notice nothing")]
)
def test_a_horizon_is_held_to_its_bounds(tmp_path: Path, bounds: str, word: str) -> None:
    """Beyond them, and where they are so wide that nothing would be noticed."""
    (verdict,) = budget(read_set(made(tmp_path, file=FILE.replace("[6.0, 8.0]", bounds)))).verdicts()
    assert word in verdict.fault


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ('fit = ["size", "decay", "frequency"]', 'fit = ["size", "decoy"]', 'did you mean "decay"'),
        ('fit = ["size", "decay", "frequency"]', "", "belong together"),
        ("to = 4.0", "to = -1.0", "nothing is identified"),
        ("to = 4.0", "to = 9.0", "is left to predict"),
        ('horizon = "t"', "", "say in \\[split\\]"),
        ('horizon = "t"', 'horizon = "s"', "has no s"),
        ("width = 0.1", "width = 0.0", "has width 0"),
        ("to = 4.0", "upto = 4.0", "upto"),
    ],
)
def test_a_wrong_split_is_refused_by_name(tmp_path: Path, old: str, new: str, word: str) -> None:
    """When the file is read."""
    with pytest.raises(CaseError, match=word):
        read_set(made(tmp_path, file=FILE.replace(old, new, 1)))


@pytest.mark.parametrize(
    ("model", "word"),
    [
        (MODEL.replace("a * exp", "a * inputs['frequency'] * exp").replace("cos(w *", "cos(2.1 *"), "size"),
        (MODEL.replace("cos(w * p", "cos(2.1 * p"), '"frequency"'),
    ],
)
def test_what_readings_do_not_determine_is_refused_by_name(tmp_path: Path, model: str, word: str) -> None:
    """A product of two inputs, and an input that does nothing."""
    with pytest.raises(CaseError, match=f"do not determine.*{word}"):
        budget(read_set(made(tmp_path, model=model)))
