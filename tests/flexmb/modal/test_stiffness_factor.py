"""One factor on the stiffness of a body with modal data: closed forms, derivatives, and all ways out of the scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

import flexmb as fm
from crosscheck.engines.exudyn.modal import integrals
from crosscheck.export.model import modal_data
from flexmb.advisor.modes import with_modes
from flexmb.dense.dense_system import DenseSystem
from flexmb.interchange.sid import imported_sid, read_sid, sid_of, write_sid
from flexmb.modal.flexible import flexible_model
from flexmb.scene.bodies import Body, Level, ModalBody, SidBody
from flexmb.scene.modal_data import modal_arrays
from flexmb.surrogate.points import modal_points
from tests.bounds import relative
from tests.flexmb.interchange.made_bodies import beam

FACTOR = "rod.stiffness_factor"
ROUNDING = 1e-12
T_END = 0.02
START = fm.AngularCoordinate(angle_rad=0.4, rate_rad_s=3.0)
TIGHT = {"rtol": 1e-12, "atol": 1e-14}


@pytest.fixture(params=["points", "npz", "sid"])
def body(request: pytest.FixtureRequest, tmp_path: Path) -> Body:
    """The same clamped beam as modal data of each kind."""
    if request.param == "sid":
        write_sid(sid_of(beam()), tmp_path / "rod.sid")
        return SidBody(name="rod", file=str(tmp_path / "rod.sid"))
    own = raw()
    if request.param == "points":
        return own
    arrays = modal_arrays(own)
    np.savez(tmp_path / "rod.npz", **arrays.given)
    return replace(own, points=(), stiffness=(), damping=(), file=str(tmp_path / "rod.npz"))


def raw() -> ModalBody:
    (body,) = modal_points(held(beam())).bodies
    assert isinstance(body, ModalBody)
    return body


def held(body: Body, level: Level = "full", eta: tuple[float, ...] = ()) -> fm.Scene:
    """The body clamped to ground at its root, with a dead force at its tip."""
    made = fm.SceneBuilder("held", gravity=(0, 0, 0)).add(replace(body, level=level)).weld("clamp", "ground", "rod")
    made.force("pull", "rod", node="tip", direction=(0, 1, 0), function=fm.Constant(value=2.0)).marker(
        "tip", "rod", node="tip"
    )
    if eta:
        made.modal_state("rod", coordinates=eta)
    return made.scene()


@pytest.mark.parametrize("factor", [0.25, 3.0])
def test_frequencies_scale_by_the_root_and_deflections_by_the_inverse(body: Body, factor: float) -> None:
    scene, scaled = held(body), held(replace(body, stiffness_factor=factor))
    one, other = fm.equilibrium(scene), fm.equilibrium(scaled)
    assert relative(factor * other.q, one.q) < ROUNDING and np.max(np.abs(one.q)) > 1e-4
    frequencies = [
        np.sort(np.abs(np.linalg.eigvals(fm.linearize(fm.compile(each), state).A)))
        for each, state in ((scene, one), (scaled, other))
    ]
    assert relative(frequencies[1], np.sqrt(factor) * frequencies[0]) < 1e-9


def test_a_path_of_equilibria_follows_the_factor(body: Body) -> None:
    path = fm.equilibrium_path(held(body), FACTOR, [1.0, 1.05])
    first, last = (path.at(factor)[0].q for factor in (1.0, 1.05))
    assert relative(1.05 * last, first) < 1e-9


def test_derivatives_are_those_of_the_closed_form_and_of_differences(body: Body) -> None:
    """By f, udot = M^-1 (Q - f K eta) changes by -M^-1 K eta; two compiled systems differ by that times what f does."""
    eta = tuple(0.003 * np.cos(np.arange(5.0)))
    scene = held(body, eta=eta).with_values({FACTOR: 1.3})
    system = fm.compile(scene)
    found = system.parameters([FACTOR]).accelerations(system.initial_state)[:, 0]
    one, other = (fm.compile(scene.with_values({FACTOR: f})).accelerations(system.initial_state) for f in (1.0, 2.0))
    assert relative(found, other - one) < 1e-10
    unloaded = without_loads(scene)
    alone = fm.compile(unloaded)
    pull = alone.accelerations(alone.initial_state) / 1.3  # of the elastic forces only, which are linear in f
    assert relative(found, pull) < 1e-10


def without_loads(scene: fm.Scene) -> fm.Scene:
    return replace(scene, loads=())


def test_runs_have_the_derivative_of_a_free_oscillation() -> None:
    """eta = a cos(sqrt(f) w t) of one mode: by f, -a w t sin(sqrt(f) w t) / (2 sqrt(f))."""
    own = raw()
    model = flexible_model(own)
    a, f, w = 1e-3, 1.7, np.sqrt(model.stiffness[0, 0])
    scene = without_loads(held(replace(own, stiffness_factor=f), "ruthless", (a, 0.0, 0.0, 0.0, 0.0)))
    name = f"{fm.compile(scene).state_names[0][0][0]}"
    found = fm.sensitivities(scene, T_END, [FACTOR], [name], samples=41, **TIGHT)
    t, root = found.t, np.sqrt(f)
    assert relative(found.values[:, 0], a * np.cos(root * w * t)) < 1e-8
    expected = -a * w * t * np.sin(root * w * t) / (2.0 * root)
    assert relative(found.derivatives[:, 0, 0], expected) < 1e-8
    slope = fm.gradient(scene, T_END, [FACTOR], fm.FinalValue(name), **TIGHT)
    assert relative(slope.derivatives, expected[-1:]) < 1e-8
    spread = fm.uncertainty(scene, T_END, {FACTOR: 0.01}, [name], samples=41, **TIGHT)
    assert relative(spread.sigma[:, 0], 0.01 * np.abs(expected)) < 1e-8
    measured = {"t": t, name: a * np.cos(w * t)}
    fitted = fm.fit(scene, measured, [FACTOR], **TIGHT)
    assert abs(fitted.values[0] - 1.0) < 1e-7


def test_a_body_in_motion_has_the_derivative_of_differences(body: Body) -> None:
    hung = without_loads(held(body, eta=tuple(3e-4 * np.cos(np.arange(5.0)))))
    (weld,) = hung.hinges
    scene = replace(hung, hinges=(fm.Revolute(name=weld.name, parent="ground", child="rod", rotation=START),))
    found = fm.sensitivities(
        scene, T_END, [FACTOR], ["tip.position.y", "tip.position.z"], samples=5, **TIGHT
    ).derivatives[:, :, 0]
    h = 1e-3

    def at(f: float) -> np.ndarray:
        run = fm.simulate(scene.with_values({FACTOR: f}), T_END, samples=5, **TIGHT)
        known = {name: values for name, _, values in run.columns()}
        return np.column_stack([known["tip.position.y"], known["tip.position.z"]])

    d = [(at(1.0 + s) - at(1.0 - s)) / (2.0 * s) for s in (h, 0.5 * h)]
    assert relative(found, (4.0 * d[1] - d[0]) / 3.0) < 1e-6


def test_all_ways_out_have_the_scaled_stiffness_and_what_is_not_elastic_stays(tmp_path: Path) -> None:
    own = replace(raw(), damping=tuple(map(tuple, 0.1 * np.eye(5))))
    K, scaled = modal_arrays(own).stiffness, replace(own, stiffness_factor=2.0)
    model = flexible_model(scaled)
    assert np.array_equal(model.stiffness, 2.0 * K) and np.array_equal(model.damping, 0.1 * np.eye(5))
    write_sid(sid_of(scaled), tmp_path / "rod.sid")
    back = imported_sid(read_sid(tmp_path / "rod.sid"), "rod").body
    assert back.stiffness_factor == 1.0 and relative(modal_arrays(back).stiffness, 2.0 * K) < ROUNDING
    assert np.array_equal(integrals(scaled, np.eye(3)).stiffness, 2.0 * K)
    fewer = with_modes(held(scaled), "rod", 3, "full", False, ()).bodies[0]
    assert isinstance(fewer, ModalBody) and fewer.stiffness_factor == 1.0
    assert relative(np.diag(modal_arrays(fewer).stiffness), np.sort(2.0 * np.diag(K))[:3]) < 1e-9
    exported = modal_data(model, "full")
    assert np.array_equal(exported["stiffness"], 2.0 * K)
    scene = held(scaled, eta=(1e-3, 0.0, 0.0, 0.0, 0.0))
    q = fm.compile(scene).initial_state.q
    assert relative(DenseSystem(scene).energy(q, 0.0 * q)["strain"], q @ K @ q) < ROUNDING
