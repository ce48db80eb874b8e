"""Every kind of bad scene is refused, naming place and remedy; every doubtful one runs, with a warning."""

import json
import warnings
from copy import deepcopy
from dataclasses import replace
from typing import get_args

import msgspec
import pytest

from flexmb.scene import schema as s
from flexmb.scene.check import SceneError, SceneWarning, check_and_warn, check_scene
from flexmb.scene.convert import plain, to_struct
from flexmb.scene.files import dumps, loads
from flexmb.scene.problems import Doubt, in_short
from flexmb.system.watches import WAIVERS
from tests.flexmb.scene.bad_scenes import BAD, DOUBTFUL, ORPHANING, satellite


@pytest.fixture(scope="module")
def good() -> dict:
    return json.loads(json.dumps(plain(satellite().scene(t_end=5.0))))


def test_the_good_scene_is_good(good):
    assert check_scene(to_struct(good, s.Scene), t_end=5.0) == ()
    assert check_scene(to_struct(good, s.Scene)) == ()


@pytest.mark.parametrize("name", BAD)
def test_a_bad_scene_is_refused_with_place_and_remedy(good, name):
    """The defect put in is reported, at its place, and nothing else."""
    mutate, *fragments = BAD[name]
    data = deepcopy(good)
    mutate(data)
    with pytest.raises(SceneError) as error:
        check_scene(to_struct(data, s.Scene), t_end=5.0)
    assert len(error.value.problems) == (2 if name in ORPHANING else 1), str(error.value)
    problem = error.value.problems[0]
    _says(problem, *fragments)
    assert str(problem) in str(error.value)


@pytest.mark.parametrize("name", DOUBTFUL)
def test_a_doubtful_scene_is_warned_of_until_it_is_waived(good, name):
    """With place, remedy and the word that waives it; no other word does."""
    mutate, *fragments, waiver = DOUBTFUL[name]
    data = deepcopy(good)
    mutate(data)
    scene = to_struct(data, s.Scene)
    (doubt,) = check_scene(scene, t_end=5.0)
    assert doubt.waiver == waiver
    _says(doubt, *fragments)
    assert f'allow = ["{waiver}"]' in str(doubt)
    with pytest.warns(SceneWarning, match=waiver):
        check_and_warn(scene)
    others = tuple(word for word in get_args(s.Waiver) if word != waiver)
    assert check_scene(msgspec.structs.replace(scene, allow=others)) == (doubt,)
    waived = msgspec.structs.replace(scene, allow=(waiver,))
    assert loads(dumps(waived)) == waived
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_and_warn(waived)


def test_every_waiver_is_needed_by_something():
    """What motions exceed is known when there is one (tests/flexmb/levels/test_watches.py)."""
    assert {waiver for *_, waiver in DOUBTFUL.values()} | set(WAIVERS) == set(get_args(s.Waiver))


def test_an_unknown_waiver_is_refused(good):
    with pytest.raises(SceneError, match="allow"):
        to_struct(good | {"allow": ["everything"]}, s.Scene)


def test_a_defect_is_an_error_whatever_is_waived(good):
    """Doubts do not hide defects, not even those that are looked for last."""
    data = deepcopy(good)
    DOUBTFUL["stiffness in kN"][0](data)
    BAD["gimbal lock at the start, a hinge beyond"][0](data)
    with pytest.raises(SceneError, match="gimbal lock") as error:
        check_scene(to_struct(data | {"allow": list(get_args(s.Waiver))}, s.Scene))
    assert len(error.value.problems) == 1


def test_a_warning_names_what_repeats_once():
    doubt = Doubt("$.bodies[0]", "odd", "check", "wave_speed")
    text = in_short("many", [replace(doubt, where=f"$.bodies[{i}]") for i in range(1000)])
    assert "999 more" in text and len(text.splitlines()) == 3


def _says(problem, where, what, remedy):
    for fragments, text in ((where, problem.where), (what, problem.what), (remedy, problem.remedy)):
        for fragment in fragments:
            assert fragment in text, text
