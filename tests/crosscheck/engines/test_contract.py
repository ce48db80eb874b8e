"""One contract for every engine found: its clauses, and Newton and Euler on random scenes of every kind of hinge.

An engine whose library is missing is skipped with its reason, as is a scene an engine says it cannot represent.
"""

import numpy as np
import pytest

from crosscheck.conformance.catalogue import CLAUSES
from crosscheck.conformance.clause import POINTWISE
from crosscheck.conformance.trial import try_clause
from crosscheck.engines.contract import Engine, Run
from crosscheck.engines.registry import engines
from tests.crosscheck.engines.newton_euler import body_residual, hinge_forces, with_markers
from tests.crosscheck.engines.peers import installed, taking
from tests.crosscheck.engines.random_scenes import KINDS, random_scene


@pytest.fixture(params=list(engines()))
def engine(request) -> Engine:
    return installed(request.param)


def near(value, scale: float = 1.0):
    return pytest.approx(np.array(value, dtype=float), rel=POINTWISE, abs=POINTWISE * scale)


@pytest.mark.parametrize("clause", CLAUSES.values(), ids=lambda clause: clause.name)
@pytest.mark.filterwarnings("ignore:.*is doubtful")
def test_every_clause_is_kept_where_it_is_offered(engine, clause):
    outcome = try_clause(engine, clause)
    if outcome.status == "not offered":
        pytest.skip(f"{engine.name}: {outcome.message}")
    assert outcome.status == "holds", f"{outcome.sentence}\n{outcome.message}"


@pytest.mark.parametrize("kind", KINDS)
def test_every_hinge_kind_obeys_newton_and_euler(engine, kind):
    """A chain ground - kind - revolute - kind at a random state: every body's equations and every hinge's forces."""
    rng = np.random.default_rng(KINDS.index(kind))
    kinds = ("free" if kind == "weld" else kind, "revolute", kind)
    scene = with_markers(random_scene(rng, kinds, extras=False, nodes=False))
    snapshot = taking(engine.name, scene).compile(scene).evaluate()
    scale = max(np.abs(load).max() for load in snapshot.loads.values())
    for body in scene.bodies:
        assert body_residual(scene, snapshot, body.name) == near(np.zeros(6), scale), body.name
    for hinge in scene.hinges:
        across, given = hinge_forces(scene, snapshot, hinge)
        assert across == near(given, scale), hinge.name


@pytest.mark.parametrize("kind", KINDS)
def test_velocity_is_the_rate_of_position(engine, kind):
    """Positions of short runs forth and the initial velocity: x(h) = x + h v + h^2/2 a + O(h^3)."""
    rng = np.random.default_rng(50 + KINDS.index(kind))
    scene = random_scene(rng, (kind, "revolute"), extras=False)
    model = taking(engine.name, scene).compile(scene)
    start = model.evaluate()
    h = 1e-3
    run = model.simulate(Run(np.array([0.0, h])), engine.efforts(scene)[-1])
    assert run.status == "finished"
    for name, marker in start.markers.items():
        predicted = marker.position + h * marker.velocity[3:] + 0.5 * h * h * marker.acceleration[3:]
        # The jerk of these scenes is of the order of 1e2 m/s^3: h^3/6 of it, with a factor of ten in hand.
        assert np.abs(run.markers[name].position[1] - predicted).max() < 2e-7
        assert np.abs(run.markers[name].velocity[1] - marker.velocity - h * marker.acceleration).max() < 1e-3


def test_work_balances_energy_where_an_engine_integrates_it(engine):
    scene = random_scene(np.random.default_rng(3), ("free", "revolute", "spherical"), driven=True)
    model = taking(engine.name, scene).compile(scene)
    run = Run(np.linspace(0.0, 1.0, 6))
    balances = []
    for effort in engine.efforts(scene)[-2:]:
        path = model.simulate(run, effort)
        if path.work is None:
            pytest.skip(f"{engine.name} does not integrate work")
        balances.append(sum(path.energy.values()) - path.work)
    refinement = np.abs(balances[0] - balances[1]).max()
    assert np.ptp(balances[-1]) <= 2.0 * refinement + 1e-9 * np.abs(balances[-1]).max()
