"""Bricard's and Bennett's linkages where branches cross: as they are shipped, and with slides that counting asks for.

As they are they never come near a singular position. A slide in every joint, or in as many as make the rows of the
closure independent, is at rest throughout; but at some places a second motion would become possible, with slides that
move, and only momentum says that it does not begin. Closed forms of the motion are those of the shipped cases.
"""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest
from msgspec.structs import asdict, replace

import flexmb
from flexmb.scene.files import load_scene
from flexmb.scene.schema import AngularCoordinate, Cylindrical, Scene
from tests.cases.shipped import closed_form
from tests.cases.test_overconstrained import FAMILY

# Settings, and the error (m) of markers that a run keeps to.
SETTINGS = {
    "dop853": ({}, 1e-7), "looser": ({"rtol": 1e-5, "atol": 1e-7}, 1e-2),
    "composite": ({"algorithm": "composite"}, 1e-7),
    "rk4": ({"method": "rk4", "step": 1e-3}, 1e-6), "coarse rk4": ({"method": "rk4", "step": 1e-2}, 1e-2),
}  # fmt: skip


def with_slides(scene: Scene, *names: str) -> Scene:
    """Joints of these names slide along their axes too."""
    return replace(
        scene,
        hinges=tuple(Cylindrical(**asdict(hinge)) if hinge.name in names else hinge for hinge in scene.hinges),
        closures=tuple(
            replace(closure, type="cylindrical") if closure.name in names else closure for closure in scene.closures
        ),
    )


def bricard_turning(m: ModuleType, rate: float) -> Scene:
    """The shipped scene with its one coordinate at a rate (rad/s) at the start."""
    scene, rates = load_scene(FAMILY / "bricard" / "scene.toml"), m.angles(np.array([m.START]))[1][:, 0]
    hinges = [
        replace(hinge, rotation=AngularCoordinate(rate_rad_s=rate * float(rates[k % 2])))
        for k, hinge in enumerate(scene.hinges)
    ]
    return replace(scene, hinges=tuple(hinges))


def bricard_course(m: ModuleType, rate: float, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) at which the coordinate comes to psi (n,), the first of which is its start, and P3 (n,3) there."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    kinetic, weight = m.energies(psi[:1])
    total, passed = kinetic[0] * rate**2 + weight[0], [0.0]
    for start, end in zip(psi[:-1], psi[1:], strict=True):
        kinetic, weight = m.energies(0.5 * (start + end) + 0.5 * (end - start) * nodes)
        passed.append(passed[-1] + 0.5 * abs(end - start) * float(weights @ np.sqrt(kinetic / (total - weight))))
    place, R = m.bars(psi)[2][:2]
    return np.array(passed), place + R.apply(m.LINKS[2])


@pytest.mark.parametrize("slides", [(), ("joint6",), ("joint2",)], ids=["as it is", "last joint", "second joint"])
@pytest.mark.parametrize("settings", SETTINGS)
def test_bricard_goes_round(settings, slides):
    """A slide in one joint makes four or five independent rows, but for two places in every turn."""
    m, (given, tolerance) = closed_form("closed_chains/bricard"), SETTINGS[settings]
    times, expected = bricard_course(m, -8.0, m.START - np.linspace(0.0, 4.0 * np.pi, 60))
    run = flexmb.simulate(with_slides(bricard_turning(m, -8.0), *slides), times[-1], samples=times, **given)
    assert run.finished, run.message
    assert np.max(np.abs(run.markers["P3"].position - expected)) < tolerance


@pytest.mark.parametrize("slides", [(), ("pin", "knee", "pivot")], ids=["as it is", "three slides"])
@pytest.mark.parametrize("settings", SETTINGS)
def test_bennett_goes_round(settings, slides):
    """With three slides branches cross where all bars lie on one line."""
    m, (given, tolerance) = closed_form("closed_chains/bennett"), SETTINGS[settings]
    times = np.linspace(0.0, 4.0, 41)
    scene = with_slides(load_scene(FAMILY / "bennett" / "scene.toml"), *slides)
    run = flexmb.simulate(scene, times[-1], samples=times, **given)
    assert run.finished, run.message
    expected = m.exact(times)
    for name, path in run.markers.items():
        assert np.max(np.abs(path.position - expected[f"marker:{name}.position"])) < tolerance


def test_bricard_itself_is_nowhere_singular():
    """The axes of its joints are of rank five all the way round, with room to spare."""
    m = closed_form("closed_chains/bricard")
    psi = np.linspace(0.0, 2.0 * np.pi, 200)
    chain = m.bars(psi)
    axes = [R.apply(axis) for axis, (_, R, _, _) in zip(m.AXES, chain, strict=True)] + [np.tile([-1.0, 0, 0], (200, 1))]
    places = [place for place, *_ in chain] + [np.tile([0.0, 0.0, 1.0], (200, 1))]
    screws = np.stack([np.hstack([a, np.cross(p, a)]) for a, p in zip(axes, places, strict=True)], axis=1)
    singular = np.linalg.svd(screws)[1]
    assert np.min(singular[:, 4]) > 0.8 and np.max(singular[:, 5]) < 1e-14
