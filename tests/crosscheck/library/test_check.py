"""Run files are read as strictly as scenes: every fault has its place and remedy, and all are found at once."""

import itertools
import math
import textwrap
import tomllib
from typing import Any

import msgspec
import numpy as np
import pytest

from crosscheck.engines.contract import MarkerPath, Trajectory
from crosscheck.library import case as case_module
from crosscheck.library.accepted import Figure
from crosscheck.library.case import CaseError, RunFile
from crosscheck.library.channels import fault
from crosscheck.library.check import check_accepted, check_run_file
from crosscheck.library.check.ranges import MOST_SAMPLES
from crosscheck.library.find import load_case
from flexmb.run.channels import channels_of, matches
from tests.crosscheck.sessions import copy_case, shipped

EXAMPLE = textwrap.dedent(case_module.__doc__.split("run.toml::")[1].split("Channels are named")[0])
NONSENSE = (-math.inf, -1.0, 0.0, 5e-324, 1e308, math.inf, math.nan)
COMPARISON = 'goals = { "marker:tip.position" = 1e-2 }'
BOUNDED = 'band = { "marker:tip.position" = [2e-2, 2e-1] }    # E is expected within'
LADDER = 'efforts = [{ engine = "native", kind = "KIND", method = "rk4", values = [VALUES] }]'


def faults_of(text: str) -> str:
    """What is said against a run file; "" if nothing."""
    try:
        check_run_file(msgspec.convert(tomllib.loads(text), RunFile))
    except CaseError as error:
        return str(error)
    return ""


def changed(old: str, new: str) -> str:
    assert old in EXAMPLE
    return EXAMPLE.replace(old, new, 1)


@pytest.mark.parametrize("number", NONSENSE)
@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("duration_s = 10.0", "duration_s = NUMBER", "$.duration_s"),
        ('name = "full"', 'name = "full"\nduration_s = NUMBER', "$.variant[1].duration_s"),
        ("refined = { segments = 32 }", "refined = { segments = 32, order = NUMBER }", "$.variant[2].refined.order"),
        ('"load" = 1e-6', '"load" = NUMBER', "$.comparison[0].goals.load"),
        (COMPARISON, COMPARISON + '\nscales = { "marker:tip.position" = NUMBER }', "$.comparison[1].scales"),
        ("[2e-2, 2e-1]", "[NUMBER, 2e-1]", "$.comparison[1].band"),
        ("[2e-2, 2e-1]", "[2e-2, NUMBER]", "$.comparison[1].band"),
        ("[7.5, 8.5]", "[8.5, NUMBER]", "$.comparison[2].diverged_s"),
        ("limit = 1e-9", "limit = NUMBER", "$.conservation[0].limit"),
        ("limit = 1e-9", "limit = 1e-9\nscale = NUMBER", "$.conservation[0].scale"),
        ("duration_s = 10.0", "duration_s = 10.0\ntime_limit_s = NUMBER", "$.time_limit_s"),
        (
            'goals = { "marker:tip.position" = 1e-6 }',
            'goals = { "marker:tip.position" = NUMBER }',
            "$.control[0].goals",
        ),
    ],
)
def test_numbers_that_are_no_sizes_are_refused(old: str, new: str, place: str, number: float) -> None:
    tiny_but_positive = number == 5e-324 and ("goals" in place or "limit" in place)
    if not tiny_but_positive:
        assert place in faults_of(changed(old, new.replace("NUMBER", repr(number))))


@pytest.mark.parametrize("kind", ["step", "tolerance"])
def test_efforts_that_are_none_are_refused(kind: str) -> None:
    for values in itertools.product((*NONSENSE, 1.0), repeat=2):
        text = LADDER.replace("KIND", kind).replace("VALUES", f"{values[0]}, {values[1]}")
        assert "$.variant[1].efforts[0].values" in faults_of(
            changed('engines = ["native"]', f'engines = ["native"]\n{text}')
        )


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('a = { variant = "full"', 'a = { variant = "fool"', 'no variant "fool"; the variants are rigid, full'),
        ('engine = "native" }\nb', 'engine = "exudyn" }\nb', 'engine "exudyn" does not run variant "full"'),
        ('b = { variant = "rigid", engine = "pinocchio" }', 'b = { variant = "rigid", engine = "adams" }', "adams"),
        ('reason = "above the critical speed the unstiffened body diverges"', "", "needs a reason"),
        ("segments = 16", "", "$.variant[2].segments"),
        ('transform = "segments"', "", "$.variant[2].segments"),
        ('transform = "segments"', 'transform = "substructures"', 'give it exactly with "segments"'),
        ('engines = ["native"]', 'pieces = 2\nengines = ["native"]', 'give it exactly with "substructures"'),
        ("refined = { segments = 32 }", "refined = { pieces = 32 }", "$.variant[2].refined.pieces"),
        ('scene = "flexible.toml"', "eigenmodes = 1", "$.variant[1].eigenmodes"),
        ('scene = "flexible.toml"', 'split_body = "a"', "$.variant[1].split_body"),
        ('engines = ["native"]', "engines = []", "name at least one engine"),
        ('also = ["native-frisch"]', 'also = ["native"]', "native is among the engines already"),
        ('name = "full"', 'name = "rigid"', "two variants have the same name"),
        ('reference = "rigid"', 'reference = "stiff"', 'no variant "stiff"'),
        ("duration_s = 10.0", "duration_s = 0.0", "needs a duration"),
        ("duration_s = 10.0", "duration_s = 10.0\ntime_limit_s = 0", "$.time_limit_s: 0 makes no sense"),
        ('goals = { "marker:tip.position" = 1e-6 }', "goals = {}", "at least one channel"),
        ("samples = 201", "samples = 1000000000", "every run is held at all of them"),
        ("samples = 201", "samples = 1", "cannot have 1 samples"),
        ("samples = 201", f"samples = {MOST_SAMPLES + 1}", "$.samples"),
        ('name = "full"', 'name = "full"\nsamples = 1000000000', "$.variant[1].samples"),
        ('title = "Pendulum with two arms"', 'title = " "', "$.title"),
        ('name = "full"', 'name = ""', "$.variant[1].name"),
        ('name = "flexible to the end"', 'name = "rigid, all engines"', "two comparisons have the same name"),
        ('["native", "pinocchio", "mujoco", "exudyn"]', '["native", "native"]', 'engine "native" is listed twice'),
        ('also = ["native-frisch"]', 'also = ["native-frisch", "native-frisch"]', "listed twice"),
        ('b = { variant = "segments", engine = "pinocchio" }', 'b = { variant = "full", engine = "native" }',
         "agrees with itself"),
        ('variant = "rigid"\ngoals', 'variant = "rigid"\nengines = ["native"]\ngoals', "nobody to be compared with"),
        ('engines = ["native", "pinocchio", "mujoco", "exudyn"]', 'engines = ["native"]', "nobody to be compared with"),
        ('name = "full"', 'name = "full"\nduration_s = 5.0', "comparison[1]"),
        ('name = "full"', 'name = "full"\nsamples = 101', "have other sample times"),
        ("refined = { segments = 32 }", "refined = { segments = 16 }", "16 is not finer than 16"),
        ("refined = { segments = 32 }", "refined = {}", "refines nothing"),
        ("refined = { segments = 32 }", "refined = { elements = 0 }", "$.variant[2].refined.elements"),
        ("segments = 16", "segments = 0", "$.variant[2].segments"),
        ('"load" = 1e-6', '"laod" = 1e-6', '"laod" can name no channel'),
        ('"load" = 1e-6', '"load:elbow.tork" = 1e-6', 'there is no "tork" of a load'),
        ('observable = "marker:tip.position"', 'observable = "marker:tip.place"', "$.chart[0].observable"),
        (COMPARISON, COMPARISON + '\nscales = { "makrer" = 1.0 }', "$.comparison[1].scales"),
        (BOUNDED, "", "an expected differ needs its bounds"),
        (BOUNDED, 'band = { "marker:tip.position" = [1e-6, 2e-1] }', "grow by more than 100"),
        (BOUNDED, 'band = { "load" = [2e-2, 2e-1] }', 'no band for "marker:tip.position"'),
        (BOUNDED, BOUNDED + '\nbecause = "so"', "bounds nothing"),
        ('expect = "differ"', 'expect = "failed"', 'because = "..."'),
        ('expect = "differ"', 'expect = "refused"', 'because = "..."'),
        ('expect = "differ"', 'expect = "diverged"', "diverged_s = [earliest, latest]"),
        ("diverged_s = [7.5, 8.5]", "diverged_s = [0.0, 10.0]", "more than 0.25 of the run's 10 s"),
        ("diverged_s = [7.5, 8.5]", "diverged_s = [9.5, 10.5]", "no time of 10 s"),
        (BOUNDED, 'because = " "', "an expected differ needs its bounds"),
        ('expect = "differ"', 'because = " "\nexpect = "refused"', "an expected refused needs its bounds"),
        ("diverged_s = [7.5, 8.5]", "", "an expected diverged needs its bounds"),
        ("limit = 1e-9", 'limit = 1e-9\nexpect = "differ"\nreason = "so"', "$.conservation[0].band"),
        ("limit = 1e-9", 'limit = 1e-9\n\n[[conservation]]\nvariant = "rigid"\nquantity = "energy"\nlimit = 1e-8',
         "judged above already"),
        ("limit = 1e-9", 'limit = 1e-9\nengines = ["native-frisch"]', 'engine "native-frisch" does not run variant'),
    ],
)  # fmt: skip
def test_what_cannot_be_run_or_judged_is_refused(old: str, new: str, said: str) -> None:
    found = faults_of(changed(old, new))
    assert said in found
    assert "->" in found


def test_all_faults_are_found_at_once() -> None:
    text = changed("duration_s = 10.0", "duration_s = nan").replace("samples = 201", "samples = 0")
    assert faults_of(text.replace("limit = 1e-9", "limit = inf")).count("->") == 3


def test_two_controls_of_one_name_are_refused() -> None:
    """Their runs would be recorded under one key, each as if it were the other."""
    block = EXAMPLE[EXAMPLE.index("[[control]]") : EXAMPLE.index("[[conservation]]")]
    assert "two controls have the same name" in faults_of(changed("[[conservation]]", block + "[[conservation]]"))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("samples = 81", "samples = true", "samples"),
        ("samples = 81", "samples = 81.5", "samples"),
        ("duration_s = 4.0", 'duration_s = "long"', "duration_s"),
        ("limit = 1e-8", "limits = 1e-8", 'did you mean "limit"?'),
        ('quantity = "energy"', 'quantity = "enery"', 'did you mean "energy"?'),
    ],
)
def test_types_and_unknown_keys_name_place_and_remedy(tmp_path: Any, old: str, new: str, said: str) -> None:
    folder = copy_case(tmp_path)
    text = (folder / "run.toml").read_text(encoding="utf-8")
    (folder / "run.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(CaseError, match=r"run\.toml") as refusal:
        load_case(folder)
    assert said in str(refusal.value)
    assert "->" in str(refusal.value)


EVERYTHING = Trajectory(
    status="finished", message="", times=np.arange(2.0),
    markers={"tip": MarkerPath(np.ones((2, 3)), np.ones((2, 4)), np.ones((2, 6)))}, loads={"tip": np.ones((2, 6))},
    wheel_loads={"tip": np.ones((2, 6))}, drives={"tip": np.ones((2, 1))},
    energy={kind: np.ones(2) for kind in ("kinetic", "strain", "spring", "gravity")}, momentum=np.ones((2, 6)),
    work=np.ones(2),
)  # fmt: skip


def test_the_kinds_of_patterns_are_the_kinds_of_channels() -> None:
    """Each channel and its beginnings are patterns; one wrong letter anywhere but in the name is none."""
    for channel in channels_of(EVERYTHING):
        kind, colon, rest = channel.partition(":")
        for pattern in (channel, channel.partition(".")[0], kind.partition(".")[0], channel.replace("tip", "*")):
            assert fault(pattern) == "", pattern
            assert matches(pattern, channel)
        wrong = channel.replace("tip", "?") if colon else channel
        for i, letter in enumerate(wrong):
            if letter.isalpha():
                assert fault(wrong[:i] + "z" + wrong[i + 1 :]), wrong


def test_the_library_is_as_strict_as_it_asks_others_to_be() -> None:
    assert all(faults_of((case.folder / "run.toml").read_text(encoding="utf-8")) == "" for case in shipped())


PLACE = "load:elbow.force | native (rigid) | mujoco (rigid)"


@pytest.mark.parametrize(
    ("accepted", "said"),
    [
        ({"rigid, all engines": {PLACE: Figure(1e-9, 2e-9)}}, ""),
        ({"energy conserved": {"energy.total | native (rigid) | conservation law (rigid)": Figure(1e-12)}}, ""),
        ({"rigid, some engines": {PLACE: Figure(1e-9, 2e-9)}}, "no such comparison"),
        ({"rigid, all engines": {"load:elbow.force | native": Figure(1e-9, 2e-9)}}, "no channel with two sides"),
        *[
            ({"rigid, all engines": {PLACE.replace(good, bad): Figure(1e-9, 2e-9)}}, said)
            for good, bad, said in (
                ("load:", "laod:", 'no kind of channel such as "laod:elbow.force"'),
                (":elbow.force", ".force", 'no kind of channel such as "load.force"'),
                (".force", ".farce", 'no kind of channel such as "load:elbow.farce"'),
                ("mujoco (rigid)", "mujoco (rigit)", 'no variant "rigit"'),
                ("mujoco (rigid)", "mujoco", '"mujoco" is not an engine with a variant'),
            )
        ],
        *[({"rigid, all engines": {PLACE: Figure(bad, 1.0)}}, "are no figures") for bad in (-1.0, math.inf, math.nan)],
        *[({"rigid, all engines": {PLACE: Figure(1.0, bad)}}, "are no figures") for bad in (-1.0, math.inf, math.nan)],
    ],
)
def test_accepted_figures_are_read_as_strictly(accepted: dict, said: str) -> None:
    run = msgspec.convert(tomllib.loads(EXAMPLE), RunFile)
    if not said:
        return check_accepted(accepted, run)
    with pytest.raises(CaseError, match=said):
        check_accepted(accepted, run)


@pytest.mark.parametrize(
    ("kind", "heading"),
    [
        (RunFile, "at the top"),
        (case_module.Variant, "``variant``:"),
        (case_module.Refined, "``variant``:"),
        (case_module.EffortLadder, "``variant``:"),
        (case_module.Comparison, "``comparison``:"),
        (case_module.ComparisonSide, "``comparison``:"),
        (case_module.Control, "``control``:"),
        (case_module.Conservation, "``conservation``:"),
        (case_module.OpenChannels, "``open``:"),
        (case_module.Chart, "``chart``:"),
    ],
)
def test_the_reference_of_the_run_file_has_every_key(kind: type, heading: str) -> None:
    reference = case_module.__doc__.split("All keys,")[1].split("``library/check``")[0]
    (item,) = [part for part in reference.split("\n- ") if part.startswith(heading)]
    tables = {"variant", "comparison", "control", "conservation", "open", "chart", "reference"}
    tables = tables if kind is RunFile else set()
    keys = {field.encode_name for field in msgspec.structs.fields(kind)} - tables
    assert {key for key in keys if f"``{key}``" not in item} == set()
