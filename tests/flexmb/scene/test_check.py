"""Every kind of bad scene is refused before running, naming the place and the remedy."""

import json
from copy import deepcopy

import pytest

from flexmb.scene import schema as s
from flexmb.scene.check import SceneError, check_scene
from flexmb.scene.convert import plain, to_struct
from tests.flexmb.scene.bad_scenes import BAD, ORPHANING, satellite


@pytest.fixture(scope="module")
def good() -> dict:
    return json.loads(json.dumps(plain(satellite().scene(t_end=5.0))))


def test_the_good_scene_is_good(good):
    check_scene(to_struct(good, s.Scene), t_end=5.0)
    check_scene(to_struct(good, s.Scene))


@pytest.mark.parametrize("name", BAD)
def test_a_bad_scene_is_refused_with_place_and_remedy(good, name):
    """The defect put in is reported, at its place, and nothing else."""
    mutate, where, what, remedy = BAD[name]
    data = deepcopy(good)
    mutate(data)
    with pytest.raises(SceneError) as error:
        check_scene(to_struct(data, s.Scene), t_end=5.0)
    assert len(error.value.problems) == (2 if name in ORPHANING else 1), str(error.value)
    problem = error.value.problems[0]
    for fragments, text in ((where, problem.where), (what, problem.what), (remedy, problem.remedy)):
        for fragment in fragments:
            assert fragment in text, text
    assert str(problem) in str(error.value)
