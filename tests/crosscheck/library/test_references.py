"""The rules of `[reference]` and of anchors, and the files of a reference read back."""

import re
from pathlib import Path

import numpy as np
import pytest

from crosscheck.library.case import CaseError
from crosscheck.library.find import load_case
from crosscheck.library.reference import current_reference, parse_values, values_text
from tests.crosscheck.sessions import copy_case, shipped, versus

GOOD = versus("fine", "stepper") + """
[reference]
variant = "rigid"
samples = 11

[[reference.route]]
engine = "fine"
efforts = [{ engine = "fine", kind = "tolerance", method = "dop853", values = [1e-6, 1e-8] }]

[[reference.route]]
engine = "stepper"
"""
ANCHOR = """
[[anchor]]
channel = "marker:tip.position"
component = "x"
t_s = 1.0
value = 0.5
uncertainty = 1e-3
source = "a book"
"""
BAD = [
    ('variant = "rigid"\nsamples', 'variant = "rigit"\nsamples', "reference.variant", 'no variant "rigit"'),
    ("samples = 11", "samples = 12", "reference.samples", "give one of 21, 11, 6, 5, 3, 2"),
    ("samples = 11", "samples = 1", "reference.samples", "1 samples"),
    ("samples = 11", "samples = 41", "reference.samples", "not some of the 21"),
    ("samples = 11", f"samples = {10**400}", "reference.samples", "not some of the 21"),
    ("samples = 11", "horizon_s = 3.0", "reference.horizon_s", "3 makes no sense"),
    ("samples = 11", "horizon_s = nan", "reference.horizon_s", "nan makes no sense"),
    ("samples = 11", 'channels = ["marker.position"]', "reference.channels", "can name no channel"),
    ("samples = 11", 'engines = ["third"]', "reference.engines", 'engine "third" does not run'),
    ("samples = 11", 'engines = ["fine", "fine"]', "reference.engines", "listed twice"),
    ("samples = 11", "goals = { marker = 0.0 }", "reference.goals", "0 is no part of the range"),
    ("samples = 11", "sample = 11", "reference", "samples"),
    ('[[reference.route]]\nengine = "stepper"\n', "", "reference.route", "two independent routes at least"),
    ('engine = "stepper"', 'engine = "stepper"\nexact = "e.py"', "reference.route[1]", "an engine or a closed form"),
    ('engine = "stepper"', "relative_uncertainty = 1e-9", "reference.route[1]", "an engine or a closed form"),
    ('engine = "stepper"', 'engine = "stepper"\nwitness = true', "reference.route", "take `witness` out"),
    ('engine = "stepper"', 'engine = "stepper"\nchannels = ["m"]', "reference.route[1].channels", "no channel"),
    ('engine = "stepper"', 'equations = "../e.py"', "reference.route[1].equations", "in the case's folder"),
    ('engine = "stepper"', 'exact = "e.py"\nequations = "e.py"', "reference.route[1]", "only one of them"),
    ('engine = "stepper"', 'exact = "../e.py"', "reference.route[1].exact", "in the case's folder"),
    ('engine = "stepper"', 'exact = "e.py"\nrelative_uncertainty = 0.0', "relative_uncertainty", "0 makes no sense"),
    ('engine = "stepper"', 'engine = "stepper"\nvariant = "soft"', "reference.route[1].variant", 'no variant "soft"'),
    ('{ engine = "fine"', '{ engine = "stepper"', "reference.route[0].efforts[0].engine", "name the same engine"),
    ("values = [1e-6, 1e-8]", "values = [1e-6]", "reference.route[0].efforts[0].values", "at least two efforts"),
    ("values = [1e-6, 1e-8]", "values = [1e-8, 1e-6]", "reference.route[0].efforts[0].values", "they do not fall"),
]


def test_a_run_of_impossibly_many_samples_is_refused_at_once(tmp_path: Path) -> None:
    """Nothing counts what divides them, nor divides by them."""
    text = GOOD.replace("samples = 11", "samples = 11\nhorizon_s = 0.5")
    file = copy_case(tmp_path, text) / "run.toml"
    file.write_text(re.sub(r"(?m)^samples = 21$", f"samples = {10**400}", file.read_text(), count=1))
    with pytest.raises(CaseError, match="a run cannot have 1000"):
        load_case(file.parent)


@pytest.mark.parametrize(("old", "new", "place", "said"), BAD, ids=[f"{new[:30]}" for _, new, _, _ in BAD])
def test_a_bad_recipe_is_refused_with_its_place(tmp_path: Path, old: str, new: str, place: str, said: str) -> None:
    assert old in GOOD
    with pytest.raises(CaseError) as refused:
        load_case(copy_case(tmp_path, GOOD.replace(old, new)))
    assert place in str(refused.value)
    assert said in str(refused.value)


def test_a_good_recipe_is_read(tmp_path: Path) -> None:
    recipe = load_case(copy_case(tmp_path, GOOD)).run.reference
    assert recipe is not None
    assert [route.engine for route in recipe.routes] == ["fine", "stepper"]


@pytest.mark.parametrize(("old", "new", "place"), [
    ("marker:tip.position", "marker:tip.place", "anchor[0].channel"),
    ("value = 0.5", "value = nan", "anchor[0].value"),
    ("1e-3", "0.0", "anchor[0].uncertainty"),
    ("1e-3", "inf", "anchor[0].uncertainty"),
    ("1e-3", "nan", "anchor[0].uncertainty"),
    ("t_s = 1.0", "t_s = -1.0", "anchor[0].t_s"),
    ("a book", " ", "anchor[0].source"),
])  # fmt: skip
def test_a_bad_anchor_is_refused_with_its_place(tmp_path: Path, old: str, new: str, place: str) -> None:
    folder = copy_case(tmp_path, GOOD)
    file = folder / "provenance.toml"
    file.write_text(file.read_text(encoding="utf-8") + ANCHOR.replace(old, new), encoding="utf-8")
    with pytest.raises(CaseError, match="provenance.toml") as refused:
        load_case(folder)
    assert place in str(refused.value)


TIMES = np.linspace(0.0, 1.0, 5)
CHANNELS = {
    "marker:a.b.position": np.random.default_rng(0).normal(size=(5, 3)),
    "marker:a.b.orientation": np.random.default_rng(1).normal(size=(5, 4)) * 1e-300,
    "drive:ball": np.random.default_rng(2).normal(size=(5, 2)),
    "drive:hinge": np.random.default_rng(2).normal(size=(5, 1)),
    'load:a, "b".force': np.random.default_rng(3).normal(size=(5, 3)) * 1e300,
    "energy.total": np.random.default_rng(4).normal(size=(5, 1)),
    "work": np.random.default_rng(5).normal(size=(5, 1)),
}


def test_numbers_come_back_to_the_last_bit() -> None:
    times, channels = parse_values(values_text(TIMES, CHANNELS), "made")
    np.testing.assert_array_equal(times, TIMES)
    assert list(channels) == list(CHANNELS)
    for name, rows in CHANNELS.items():
        assert channels[name].tobytes() == rows.tobytes()


@pytest.mark.parametrize(("old", "new", "said"), [
    ("t [s]", "time", "first column"),
    ("position.x [m]", "position.x [mm]", "mm"),
    ("position.y", "position.z", "position.z"),
    ("\n0.25,", "\n0.75,", "do not rise"),
    ("\n0.25,", "\n0.25,1,", "line 3 has"),
    ("\n0.25,", "\nnan,", "not finite"),
    ("\n0.25,", "\nx,", "could not convert"), ("\n0.25,", '\n"0.2"5,', "not a table"),
    ("\n0.25,", "\n" + "0" * 200_000 + ",", "not a table"),
])  # fmt: skip
def test_a_bad_file_is_refused(old: str, new: str, said: str) -> None:
    text = values_text(TIMES, CHANNELS)
    assert old in text
    with pytest.raises(CaseError, match="made: ") as refused:
        parse_values(text.replace(old, new), "made")
    assert said in str(refused.value)


def test_every_shipped_case_has_a_reference_of_itself() -> None:
    """Cases without a recipe are none: what is stored belongs to the scene, and ends no later than the case."""
    for case in shipped():
        assert case.run.reference is not None, case.name
        found = current_reference(case)
        assert all(0.0 < known.uncertainty < np.inf for known in found.knowledge.channels.values())
        assert found.times[-1] <= (case.run.variant(found.knowledge.variant).duration_s or case.run.duration_s)
        sized = [known for known in found.knowledge.channels.values() if known.scale > 0.0]
        # The least known are closed forms of what moves slowly, such as the roll-up: inertia leaves 8e-4 of the range.
        assert np.median([known.uncertainty / known.scale for known in sized]) < 1e-3, case.name
