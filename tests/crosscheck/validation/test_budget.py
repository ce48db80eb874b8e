"""Budgets of measured sets whose prediction is known: parts, coverage, what a file may claim, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from crosscheck.cli.common import app
from crosscheck.library.case_error import CaseError
from crosscheck.validation.budget import budget, document
from crosscheck.validation.measured_set import MeasuredSet, find_set, find_sets, read_set, shipped_sets
from crosscheck.validation.model import MeasuredModel
from flexmb.scene.user_code import no_user_code

HEAD = """\
title = "A line"
physics = "none"
sources = ["made up"]
read_from = "here"
instrument = "none"
licence = "ours"
digitised = "no"
fitted = "nothing"
left_out = "nothing"
"""
INPUTS = """
[[inputs]]
name = "slope"
value = 2.0
width = 0.1
stated = true
why = "so"

[[inputs]]
name = "offset"
value = 1.0
width = 0.3
kind = "limits"
stated = true
why = "so"
"""
SERIES = """
[[series]]
name = "line"
what = "a number"
unit = "m"
reading = 0.05
stated = true
why = "so"
size = 10.0
expect = "{expect}"
within = {within}
reason = "so"
"""
LINE = """\
def predict(points, inputs, effort):
    return [inputs["slope"] * p.conditions["x"] + inputs["offset"] + (0.0 if effort else 0.02) for p in points]
"""
SLOPE = """
def derivatives(points, inputs, effort):
    return {"slope": [p.conditions["x"] for p in points]}
"""
X = np.array([1.0, 2.0, 5.0])


def made(
    folder: Path, off: float = 0.1, expect: str = "validated", within: float = 0.015, model: str = LINE, **files: str
) -> Path:
    """A set whose readings are `off` below the line."""
    rows = "".join(f"line,{x:g},{2.0 * x + 1.0 - off:.6f}\n" for x in X)
    content = {
        "measured.toml": HEAD + INPUTS + SERIES.format(expect=expect, within=within),
        "points.csv": "series,x,measured\n" + rows,
        "model.py": model,
    } | {name.replace("_", "."): text for name, text in files.items()}
    for name, text in content.items():
        (folder / name).write_text(text)
    return folder


def test_each_part_is_what_it_must_be(tmp_path: Path) -> None:
    """A line is linear in its inputs: first order is exact, and both differences agree."""
    known = budget(read_set(made(tmp_path)))
    np.testing.assert_allclose(known.error, 0.1, rtol=0, atol=1e-12)
    np.testing.assert_allclose(known.u_num, 0.02, rtol=0, atol=1e-12)
    np.testing.assert_allclose(known.by_input, np.column_stack([0.1 * X, np.full(3, 0.3 / 3**0.5)]), rtol=1e-12)
    assert np.max(known.curved) < 1e-12
    np.testing.assert_allclose(known.u_val**2, known.u_num**2 + known.u_input**2 + 0.05**2, rtol=1e-12)
    assert np.all(known.within) and known.verdicts()[0].ok


def test_samples_have_the_deviation_of_first_order(tmp_path: Path) -> None:
    """The deviation of n samples is known to 1 / sqrt(2 n) of itself; five of these are never passed by chance."""
    n = 2000
    known = budget(read_set(made(tmp_path)), samples=n, seed=1)
    assert known.sampled is not None
    np.testing.assert_allclose(known.sampled, known.u_input, rtol=5.0 / np.sqrt(2.0 * n))


def test_first_order_leaves_a_curved_model_to_samples(tmp_path: Path) -> None:
    """A model that has its least value at the nominal input has no first-order uncertainty, and samples show one."""
    curved = LINE.replace('inputs["slope"]', '(2.0 + (10.0 * (inputs["slope"] - 2.0)) ** 2)')
    known = budget(read_set(made(tmp_path, model=curved)), samples=200)
    assert known.sampled is not None
    assert np.all(np.abs(known.by_input[:, 0]) < 1e-12) and np.all(known.sampled > 2.0 * known.u_input)


def test_derivatives_are_of_fourth_order(tmp_path: Path) -> None:
    """For the fifth power the combined difference is off by 4 h^4 a, either of the two by terms in h^2."""
    known = budget(read_set(made(tmp_path, model=LINE.replace('inputs["slope"]', 'inputs["slope"] ** 5'))))
    exact = 5.0 * 2.0**4 * 0.1 * X
    h = 0.1
    np.testing.assert_allclose(known.by_input[:, 0] - exact, -0.25 * h**5 * X, rtol=1e-6)
    assert np.all(known.curved[:, 0] > 1e-3 * exact)


def test_an_exact_derivative_takes_the_place_of_differences(tmp_path: Path) -> None:
    """By the inputs that the model has derivatives by; the same budget, and half the evaluations by such an input."""
    counted = list[int]()
    exact = budget(read_set(made(tmp_path, model=LINE + SLOPE)), 500, listener=lambda done, of: counted.append(of))
    assert exact.exact == (True, False) and counted[-1] == len(counted) == 2 + 1 + 2 + 4 + 500
    np.testing.assert_allclose(exact.by_input, budget(read_set(made(tmp_path))).by_input, rtol=1e-12)
    assert exact.sampled is not None
    np.testing.assert_allclose(exact.sampled, exact.u_input, rtol=5.0 / np.sqrt(1000.0))


@pytest.mark.parametrize(
    ("derivative", "word"),
    [
        (SLOPE.replace("x\"]", "x\"] * 1.02"), 'by "slope" a deviation changes line'),
        (SLOPE.replace("slope", "offset"), 'by "offset" a deviation changes line'),
        (SLOPE.replace("slope", "slop"), 'did you mean "slope"'),
        (SLOPE.replace('p.conditions["x"]', 'float("nan")'), "is no finite number"),
        (SLOPE.replace("for p in points", "for p in points[1:]"), "an array \\(2,\\) for 3 points"),
        ("\ndef derivatives(points, inputs, effort):\n    return [1.0]\n", "give a dict"),
    ],
)
def test_a_wrong_derivative_is_refused_by_name(tmp_path: Path, derivative: str, word: str) -> None:
    """Two per cent suffice; what the reading hides by a hundred would not matter."""
    with pytest.raises(CaseError, match=word):
        budget(read_set(made(tmp_path, model=LINE + derivative)))


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"off": 3.0, "within": 0.4}, '"validated" was expected'),
        ({"off": 0.1, "expect": "model error"}, '"model error" was expected'),
        ({"off": 0.1, "within": 0.005}, "the largest error is 0.01"),
        ({"off": 0.1, "within": 0.5}, "more than 2 times the largest error"),
        ({"off": 3.0, "expect": "model error", "within": 0.4}, ""),
    ],
)
def test_a_claim_is_held(tmp_path: Path, change: dict[str, Any], word: str) -> None:
    """What a file expects must come out, inside a bound that would notice."""
    (verdict,) = budget(read_set(made(tmp_path, **change))).verdicts()
    assert word in verdict.fault and verdict.ok == (not word)


@pytest.mark.parametrize("width", ["1e200", "1e3"])
def test_an_uncertainty_that_nothing_can_miss_is_no_validation(tmp_path: Path, width: str) -> None:
    """Inputs so wide that every reading is within, as far as infinity."""
    wide = (HEAD + INPUTS + SERIES.format(expect="validated", within=0.015)).replace("width = 0.1", f"width = {width}")
    with np.errstate(over="ignore"):
        (verdict,) = budget(read_set(made(tmp_path, measured_toml=wide))).verdicts()
    assert verdict.within == verdict.points and "nothing could be outside" in verdict.fault


def test_one_point_in_twenty_may_be_outside(tmp_path: Path) -> None:
    """19 of 20 within are validated, 18 are not."""
    for outside, standing in ((1, "validated"), (2, "model error")):
        rows = "".join(f"line,1,{3.0 - (5.0 if i < outside else 0.0):g}\n" for i in range(20))
        (verdict,) = budget(read_set(made(tmp_path, points_csv="series,x,measured\n" + rows))).verdicts()
        assert verdict.standing == standing and verdict.within == 20 - outside


@pytest.mark.parametrize(
    ("files", "word"),
    [
        ({"model_py": "def other(): pass"}, "no function predict"),
        ({"model_py": "1 /"}, "cannot be loaded: SyntaxError"),
        ({"model_py": "def predict(p, i, e): raise ValueError('no')"}, "ValueError: no"),
        ({"model_py": "def predict(p, i, e): return [0.0]"}, "an array (1,) for 3 points"),
        ({"model_py": "def predict(p, i, e): return [0.0, float('nan'), 0.0]"}, "no finite number"),
        ({"model_py": "def predict(p, i, e): return 'abc'"}, "predict at effort 0"),
        ({"points_csv": "series,x\nline,1\n"}, "columns series and measured"),
        ({"points_csv": "series,x,measured\nlime,1,2\n"}, 'did you mean "line"'),
        ({"points_csv": "series,x,measured\nline,1\n"}, "line 2 has 2 columns"),
        ({"points_csv": "series,x,measured\nline,inf,2\n"}, 'x is "inf"'),
        ({"points_csv": "series,x,measured\nline,1,\n"}, "there is no reading"),
        ({"points_csv": "series,x,measured\n"}, "has no point"),
        (
            {
                "measured_toml": HEAD + SERIES.format(expect="validated", within=1).replace("size = 10.0\n", ""),
                "points_csv": "series,x,measured\nline,1,0\n",
            },
            "are 0: give its size",
        ),
        (
            {"measured_toml": HEAD + SERIES.format(expect="validated", within=1) + 'over = "y"'},
            "is drawn by y, which is no column of",
        ),
        (
            {
                "measured_toml": HEAD + SERIES.format(expect="validated", within=1) + 'over = "x"',
                "points_csv": "series,x,measured\nline,,2\n",
            },
            "has no x, over which it is drawn",
        ),
        ({"points_csv": ""}, "columns series and measured"),
        ({"points_csv": "series,x,measured\nline,1," + 140_000 * "1"}, "field larger than field limit"),
        ({"measured_toml": HEAD + INPUTS}, "series"),
        ({"measured_toml": HEAD.replace("title", "titel")}, "titel"),
        ({"measured_toml": HEAD + INPUTS + INPUTS + SERIES.format(expect="validated", within=1)}, "there twice"),
        (
            {"measured_toml": HEAD + INPUTS.replace("0.1", "-0.1") + SERIES.format(expect="validated", within=1)},
            "width",
        ),
        ({"measured_toml": HEAD + INPUTS.replace("2.0", "nan") + SERIES.format(expect="validated", within=1)}, "value"),
        ({"measured_toml": HEAD + SERIES.format(expect="validated", within=0)}, "within and size are positive"),
        (
            {"measured_toml": HEAD + SERIES.format(expect="validated", within=1).replace("0.05", "0.0")},
            "exact readings",
        ),
        ({"measured_toml": HEAD + SERIES.format(expect="model error", within=1).replace('"so"', '""')}, "say why"),
        ({"measured_toml": HEAD + SERIES.format(expect="fine", within=1)}, "expect"),
    ],
)
def test_a_wrong_file_is_refused_by_name(tmp_path: Path, files: dict[str, str], word: str) -> None:
    """CaseError with the file, and at the command line exit code 2 without a traceback."""
    made(tmp_path, **files)
    with pytest.raises(CaseError, match="^" + str(tmp_path.resolve())) as error:
        budget(read_set(tmp_path))
    assert word in str(error.value)
    result = CliRunner().invoke(app, ["validate", str(tmp_path)])
    assert result.exit_code == 2 and "Traceback" not in result.output


def test_code_may_be_forbidden(tmp_path: Path) -> None:
    """In a block of Python, and by the option."""
    with no_user_code(), pytest.raises(CaseError, match="user code was forbidden"):
        MeasuredModel(read_set(made(tmp_path)))


def test_the_command_line(tmp_path: Path) -> None:
    """Exit codes, a table, every point, JSON alone on stdout, and one word of help for a typing error."""
    run = CliRunner().invoke
    result = run(app, ["validate", str(made(tmp_path)), "--verbose", "--samples", "3"])
    assert result.exit_code == 0 and "3 of 3 points are within" in result.output and "sampled" in result.output
    result = run(app, ["validate", str(made(tmp_path, off=3.0)), "--json"])
    assert result.exit_code == 1 and result.stdout.startswith("{")
    result = run(app, ["validate", "yoyo_dispin"])
    assert result.exit_code == 2 and "yoyo_despin" in result.output
    result = run(app, ["validate", "list"])
    assert result.exit_code == 0 and all(name in result.output for name in shipped_sets())


def test_a_document_has_every_part(tmp_path: Path) -> None:
    """What a page or another program reads."""
    known = budget(read_set(made(tmp_path)))
    content = document(known)
    assert [point["E"] for point in content["points"]] == known.error.tolist()
    assert content["series"][0]["standing"] == "validated"
    assert content["points"][0]["by_input"].keys() == {"slope", "offset"}


def test_two_folders_of_one_name_are_not_mixed_up(tmp_path: Path) -> None:
    """Results and pages are known by the name of the folder."""
    folders = []
    for each in ("a", "b"):
        place = tmp_path / each / "line"
        place.mkdir(parents=True)
        folders.append(str(made(place)))
    with pytest.raises(CaseError, match="have the same name"):
        find_sets(folders)
    assert len(find_sets([folders[0], f"{folders[0]}/../line"])) == 1


@pytest.mark.parametrize("name", shipped_sets())
def test_shipped_sets_are_whole(name: str) -> None:
    """They read, say what they left out, and load their model."""
    known: MeasuredSet = find_set(name)
    assert known.content.left_out and known.content.sources and MeasuredModel(known)


def test_a_shipped_model_predicts() -> None:
    """The one that takes least, at its lower effort: speeds after a despin, off by 15 % of the speed before at most."""
    known = find_set("yoyo_despin")
    predicted = MeasuredModel(known).predictions(known.points, known.nominal, 0)
    before = np.array([point.conditions["speed_before_rpm"] for point in known.points])
    assert np.all(np.abs(predicted - [point.measured for point in known.points]) < 0.15 * before)


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped_sets())
def test_shipped_sets_come_out_as_their_files_say(name: str) -> None:
    """Errors and standing of each series."""
    assert not [verdict.fault for verdict in budget(find_set(name)).verdicts() if not verdict.ok]
