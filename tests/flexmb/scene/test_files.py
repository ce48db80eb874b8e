"""Scene files: build -> file -> build is the identity; what a file gets wrong is named with its remedy."""

import gc
import re
from functools import cache

import msgspec
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec import inspect

from flexmb.scene import loaded
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.check import SceneWarning, check_and_warn, check_scene
from flexmb.scene.collecting import COLLECTIONS
from flexmb.scene.files import dumps, load_scene, loads, save_scene
from flexmb.scene.problems import SceneError
from tests.flexmb.scene.bad_scenes import satellite

SCALARS = {
    inspect.StrType: st.text(max_size=8),
    inspect.FloatType: st.floats(allow_nan=False),
    inspect.IntType: st.integers(-(2**63), 2**63 - 1),
    inspect.BoolType: st.booleans(),
    inspect.NoneType: st.none(),
}


def field_value(field: inspect.Field) -> st.SearchStrategy:
    """Defaults are as likely as anything else."""
    return values_of(field.type) if field.required else st.just(field.default) | values_of(field.type)


def values_of(node: inspect.Type) -> st.SearchStrategy:
    """Any value of a schema type."""
    match node:
        case inspect.StructType(cls=cls, fields=fields):
            return st.builds(cls, **{field.encode_name: field_value(field) for field in fields})
        case inspect.VarTupleType(item_type=item):
            return st.lists(values_of(item), max_size=2).map(tuple)
        case inspect.TupleType(item_types=items):
            return st.tuples(*map(values_of, items))
        case inspect.LiteralType(values=values):
            return st.sampled_from(values)
        case inspect.UnionType(types=types):
            return st.one_of(*map(values_of, types))
        case inspect.Metadata(type=inner):
            return values_of(inner)
    return SCALARS[type(node)]


@cache
def items_of(kind: type) -> st.SearchStrategy:
    """One or two items of a kind; made once, as making a strategy takes longer than drawing from it."""
    return st.lists(values_of(inspect.type_info(kind)), min_size=1, max_size=2).map(tuple)


@pytest.mark.parametrize("kind", COLLECTIONS, ids=lambda kind: kind.__name__)
@settings(max_examples=settings.default.max_examples // 5, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_round_trip_is_the_identity(kind, data):
    """Every kind of item, nested structs and functions included, with arbitrary text and bit-exact floats."""
    items = data.draw(items_of(kind))
    name = data.draw(SCALARS[inspect.StrType])
    scene = s.Scene(**({"name": name, "bodies": (), "hinges": ()} | {COLLECTIONS[kind]: items}))
    assert loads(dumps(scene)) == scene


@given(value=st.floats(allow_nan=False))
def test_floats_are_bit_exact(value):
    scene = s.Scene(name="x", bodies=(), hinges=(), gravity_m_s2=(value, 0.0, 1.0))
    assert loads(dumps(scene)).gravity_m_s2[0].hex() == value.hex()


def test_defaults_are_left_out():
    hinge = s.Revolute(name="pivot", parent="ground", child="arm", rotation=s.AngularCoordinate(angle_rad=0.5))
    text = dumps(s.Scene(name="arm", bodies=(), hinges=(hinge,)))
    assert text == (
        'name = "arm"\nbodies = []\n\n[[hinges]]\nkind = "revolute"\nname = "pivot"\nparent = "ground"\nchild = "arm"\n'
        "rotation = { angle_rad = 0.5 }\n"
    )


def modal_scene(file: str) -> s.Scene:
    return (
        SceneBuilder("panel").add(s.ModalBody(name="panel", file=file))
        .weld("mount", "ground", "panel")
    )  # fmt: skip


def test_a_scene_folder_can_be_moved(tmp_path):
    """Files are relative in TOML and absolute in a Scene, so the folder moves as a whole."""
    arrays = {"mass": np.ones(2), "position": np.eye(3)[:2], "translation_modes": np.ones((2, 3, 1))}
    (tmp_path / "a" / "data").mkdir(parents=True)
    file = tmp_path / "a" / "data" / "panel.npz"
    np.savez(file, **arrays, stiffness=np.eye(1) * 100.0)
    scene = modal_scene(str(file)).scene()
    save_scene(scene, tmp_path / "a" / "scene.toml")
    assert 'file = "data/panel.npz"' in (tmp_path / "a" / "scene.toml").read_text()
    assert load_scene(tmp_path / "a" / "scene.toml") == scene
    (tmp_path / "a").rename(tmp_path / "b")
    assert load_scene(tmp_path / "b" / "scene.toml").bodies[0].file == str(tmp_path / "b" / "data" / "panel.npz")


GOOD = """
name = "pendulum"
[[bodies]]
kind = "rigid"
name = "arm"
mass_kg = 1
inertia_kg_m2 = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
[[hinges]]
kind = "revolute"
name = "pivot"
parent = "ground"
child = "arm"
axis = [0, 1, 0]
rotation = { angle_rad = 0.3, torque_Nm = { kind = "sine", amplitude = 1, angular_frequency_rad_s = 2 } }
"""
PIVOT = ("$.hinges[0]", 'hinge "pivot"')

WRITTEN_WRONG = {
    "unknown key": ("axis =", "axes =", PIVOT, ['did you mean "axis"?']),
    "wrong unit": ("mass_kg", "mass_g", ("$.bodies[0]", 'body "arm"'), ["unit expected is kg", '"mass_kg"']),
    "unit left out": ("angle_rad", "angle", ("$.hinges[0].rotation", 'hinge "pivot"'), ["rad", '"angle_rad"']),
    "key one level too high": ("axis =", "stiffness_Nm_rad = 1\naxis =", PIVOT, ["one level deeper", "rotation"]),
    "missing key": ("mass_kg = 1", "", ("$.bodies[0]", 'body "arm"'), ['add "mass_kg" (in kg)']),
    "missing kind": ('kind = "rigid"', "", ("$.bodies[0]",), ["rigid, beam, modal, sid"]),
    "unknown kind": ('"revolute"', '"revolut"', ("$.hinges[0].kind", 'hinge "pivot"'), ['"revolute"']),
    "unknown function": ('"sine"', '"sin"', ("$.hinges[0].rotation.torque_Nm.kind",), ['"sine"']),
    "wrong type": ("mass_kg = 1", 'mass_kg = "1"', ("$.bodies[0].mass_kg", 'body "arm"'), ["in kg"]),
    "wrong length": ("[0, 1, 0]\nrot", "[0, 1]\nrot", ("$.hinges[0].axis", 'hinge "pivot"'), ["axis"]),
    "unknown table": ("[[hinges]]", "[[joints]]", ("$",), ["hinges"]),
    "not TOML": ("mass_kg = 1", "mass_kg 1", ("scene.toml", ), ["syntax"]),
}  # fmt: skip


def test_the_good_file_is_good():
    assert loads(GOOD).hinges[0].rotation.angle_rad == 0.3


@pytest.mark.parametrize(("old", "new", "where", "remedy"), WRITTEN_WRONG.values(), ids=WRITTEN_WRONG)
def test_a_wrong_file_is_refused_with_place_and_remedy(old, new, where, remedy):
    assert old in GOOD
    with pytest.raises(SceneError) as error:
        loads(GOOD.replace(old, new), name="scene.toml")
    (problem,) = error.value.problems
    for fragment in where:
        assert fragment in problem.where
    for fragment in remedy:
        assert fragment in problem.remedy


def test_the_json_schema_accepts_what_is_written():
    """The generated schema describes the files: its keys are the struct's keys."""
    schema = msgspec.json.schema(s.Scene)
    assert set(schema["$defs"]["Scene"]["properties"]) == set(s.Scene.__struct_fields__)


def test_errors_of_a_scene_name_the_file_it_was_read_from(tmp_path):
    """Of several scenes with one title, only the file tells which."""
    scene = satellite().scene()
    unsound = msgspec.structs.replace(scene, gravity_m_s2=(float("nan"), 0.0, 0.0))
    doubtful = scene.with_values({"slider.mass_kg": 1.0, "rail.translation.damping_Ns_m": -1.0})
    for each, name in ((unsound, "unsound.toml"), (doubtful, "doubtful.toml")):
        save_scene(each, tmp_path / name)
    read = load_scene(tmp_path / "unsound.toml")
    with pytest.raises(SceneError, match=re.escape(f'scene "{tmp_path / "unsound.toml"}" has 1 problem')):
        check_scene(read)
    with pytest.raises(SceneError, match='scene "satellite" has 1 problem'):
        check_scene(loads(dumps(read)))
    with pytest.warns(SceneWarning, match=re.escape(f'scene "{tmp_path / "doubtful.toml"}" is doubtful')):
        check_and_warn(load_scene(tmp_path / "doubtful.toml"))


def test_files_of_scenes_that_are_gone_are_forgotten(tmp_path):
    save_scene(satellite().scene(), tmp_path / "scene.toml")
    gc.collect()  # other tests' scenes are in cycles, and would be collected below
    before = len(loaded._files)
    scene = load_scene(tmp_path / "scene.toml")
    assert len(loaded._files) == before + 1 and loaded.called(scene) == str(tmp_path / "scene.toml")
    del scene
    gc.collect()
    assert len(loaded._files) == before
