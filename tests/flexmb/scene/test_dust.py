"""Noise of 1e-16 of a scene's scale changes no verdict: every check of every scene, good, doubtful or wrong."""

import json
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest

import flexmb as fm
from flexmb.scene import schema as s
from flexmb.scene.bodies import BeamBody
from flexmb.scene.check import SceneError, check_scene
from flexmb.scene.convert import plain, to_struct
from flexmb.scene.files import load_scene
from flexmb.scene.shapes import beam_section
from tests.flexmb.scene.bad_scenes import BAD, DOUBTFUL, ORPHANING, satellite

ROOT = Path(__file__).parents[3]
SHIPPED = [file for file in sorted((ROOT / "cases").glob("*/*/*.toml")) if 'kind = "weld"' in file.read_text() or
           "[[hinges]]" in file.read_text()]  # fmt: skip
NOISE = 1e-16
UNITS = (
    "_kg_m2", "_kg_m", "_Nm_rad", "_N_m", "_Nms_rad", "_Ns_m", "_Nm2", "_rad_s", "_m_s2", "_m_s", "_kg", "_rad",
    "_Nm", "_N", "_m", "_s",
)  # fmt: skip


def with_noise(data, seed):
    """The scene with every number changed by up to 1e-16 of the largest one with its unit, zeros of vectors and
    matrices too; a number that is zero by itself is one that is not given. Symmetric matrices stay so."""
    scales, rng = {}, np.random.default_rng(seed)
    for key, value in _numbers(data):
        scales[_unit(key)] = max(scales.get(_unit(key), 0.0), abs(value))
    return _noisy(data, scales, rng, "", False)


def _unit(key):
    return next((unit for unit in UNITS if key.endswith(unit)), key)


def _numbers(node, key=""):
    if isinstance(node, dict):
        for name, value in node.items():
            yield from _numbers(value, name)
    elif isinstance(node, list):
        for value in node:
            yield from _numbers(value, key)
    elif isinstance(node, float) and np.isfinite(node):
        yield key, node


def _noisy(node, scales, rng, key, inside):
    if isinstance(node, dict):
        return {name: _noisy(value, scales, rng, name, False) for name, value in node.items()}
    if isinstance(node, list):
        found = [_noisy(value, scales, rng, key, True) for value in node]
        if len(node) > 1 and all(isinstance(row, list) and len(row) == len(node) for row in node):
            matrix = np.array(node, float)
            if matrix.ndim == 2 and np.array_equal(matrix, matrix.T):
                found = (np.triu(found) + np.triu(found, 1).T).tolist()
        return found
    if isinstance(node, float) and np.isfinite(node) and (node or inside):
        return node + NOISE * scales[_unit(key)] * rng.uniform(-1.0, 1.0)
    return node


def verdict(data, t_end=None):
    """Kind, place and waiver of every problem."""
    try:
        found = check_scene(to_struct(data, s.Scene), t_end)
    except SceneError as error:
        found = error.problems
    return sorted((type(each).__name__, each.where, getattr(each, "waiver", "")) for each in found)


@pytest.fixture(scope="module")
def good():
    return json.loads(json.dumps(plain(satellite().scene(t_end=5.0))))


@pytest.mark.parametrize("name", ["good", *BAD, *DOUBTFUL])
def test_noise_changes_no_verdict_on_a_wrong_scene(good, name):
    """Each has the one problem that `test_check` finds in it without noise."""
    data, places = deepcopy(good), []
    if name != "good":
        mutate, places, *_ = (BAD | DOUBTFUL)[name]
        mutate(data)
    found = verdict(with_noise(data, 0), 5.0)
    assert len(found) == (0 if name == "good" else 2 if name in ORPHANING else 1), found
    assert name in ORPHANING or all(fragment in where for _, where, _ in found for fragment in places)


def _shipped(file, seeds):
    data = json.loads(json.dumps(plain(load_scene(file))))
    for seed in seeds:
        assert verdict(with_noise(data, seed)) == verdict(data), file


def test_noise_changes_no_verdict_on_a_scene_of_the_library():
    """The first of each group that is small; all with `-m slow`."""
    groups = {file.parent.parent: file for file in reversed(SHIPPED) if file.stat().st_size < 5_000}
    for file in groups.values():
        _shipped(file, [0])


@pytest.mark.slow  # a minute
def test_noise_changes_no_verdict_however_it_is_drawn(good):
    for name, (mutate, *_) in (BAD | DOUBTFUL).items():
        data = deepcopy(good)
        mutate(data)
        for seed in range(1, 8):
            assert verdict(with_noise(data, seed), 5.0) == verdict(data, 5.0), name
    for file in SHIPPED:
        _shipped(file, range(3))


@pytest.mark.parametrize("size", [1e-18, 1e-14, 1e-6, 1.0, 1e12])
def test_a_point_mass_with_dust_in_its_tensor_is_a_point_mass(size):
    """As URDF files have it: `ixz = 2.4e-35` beside a mass at half a metre. What is no dust is refused."""

    def scene(ixz):
        tensor = np.zeros((3, 3))
        tensor[0, 2] = tensor[2, 0] = ixz
        builder = fm.SceneBuilder("dusty").rigid_body("a", mass=1.3 * size, com=(0, 0, -0.5), inertia=tensor)
        return builder.revolute("j", "ground", "a", axis=(0, 1, 0)).scene()

    assert check_scene(scene(2.4e-35 * size)) == ()
    with pytest.raises(SceneError, match="not positive semidefinite"):
        scene(1e-9 * size)


@pytest.mark.parametrize("angle", [0.0, 1e-16, 1e-12, 1e-9, 1e-8, 1e-7, 9e-7])
@pytest.mark.parametrize("inertia", [(0.1, 0.15, 0.2), (1.0, 1.0, 1.9), (1e-6, 1e-6, 1e-6)])
def test_a_gimbal_near_lock_is_locked_and_not_without_inertia(angle, inertia):
    rotations = tuple(fm.AngularCoordinate(angle_rad=each) for each in (0.4, angle, -0.3))
    builder = fm.SceneBuilder("gimbal").rigid_body("b", mass=1.0, inertia=inertia)
    with pytest.raises(SceneError, match="gimbal lock"):
        builder.gimbal("j", "ground", "b", sequence="zxz", rotations=rotations).scene()


def test_a_place_that_rounding_put_beside_an_end_of_a_beam_is_that_end():
    """Nodes, stations and masses at 3 * 0.1 m of a beam of 0.3 m; what is farther off is refused."""
    (beam,) = (body for body in satellite().scene(t_end=5.0).bodies if isinstance(body, BeamBody))
    data = plain(beam) | {"length_m": 0.3, "nodes": [{"name": "end", "x_m": 3 * 0.1}]}
    data["stations"] = [station | {"x_m": x} for station, x in zip(data["stations"], (1e-17, 3 * 0.1), strict=True)]
    made = to_struct(data, BeamBody)
    assert [each.x_m for each in (*made.stations, *made.nodes)] == [0.0, 0.3, 0.3] and 3 * 0.1 > 0.3
    data["nodes"] = [{"name": "end", "x_m": 0.3 + 1e-12}]
    assert to_struct(data, BeamBody).nodes[0].x_m == 0.3 + 1e-12
    data["length_m"] = float("inf")  # is refused by checks, and no place is near its ends
    assert to_struct(data, BeamBody).nodes[0].x_m == 0.3 + 1e-12


@pytest.mark.parametrize("points", ["section", "rotary", "line"])
@pytest.mark.parametrize("level", ["ruthless", "full", "stiffened", "exact"])
def test_a_mass_on_a_beam_may_have_dust_in_its_tensor_or_be_flat_to_ten_digits(points, level):
    """Of 1e-16 of its mass and the beam's length, or J1 + J2 = J3 as it is printed; what is neither is refused."""

    def scene(tensor):
        section = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700)
        mass = fm.TipMass(x_m=2.0, mass_kg=0.5, inertia_kg_m2=plain(np.asarray(tensor)))
        builder = fm.SceneBuilder("lump").beam(
            "rod", length=2.0, elements=4, section=section, modes=3, level=level, points=points, tip_masses=(mass,)
        )
        return builder.weld("clamp", "ground", "rod").scene()

    rng = np.random.default_rng(3)
    for _ in range(4):
        dust = 1e-16 * 0.5 * 2.0**2 * rng.uniform(-1.0, 1.0, (3, 3))
        assert check_scene(scene(dust + dust.T)) == () == fm.check_scene(scene(dust + dust.T))
        still, dusty = (fm.compile(scene(each)) for each in (np.zeros((3, 3)), dust + dust.T))
        assert np.allclose(dusty.mass_matrix(dusty.initial_state), still.mass_matrix(still.initial_state), atol=1e-10)
    assert fm.check_scene(scene(np.diag([1.0 / 3.0, 1.0 / 3.0, 0.6666666667]))) == ()
    with pytest.raises(SceneError, match="triangle inequality"):
        scene(np.diag([1.0 / 3.0, 1.0 / 3.0, 0.66667]))
