"""Clauses on derivatives and frequencies: what engines and adapters get wrong in them is noticed."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest

from crosscheck.conformance.catalogue import CLAUSES
from crosscheck.conformance.linearised import LINEARISED
from crosscheck.conformance.trial import try_clause
from crosscheck.engines.contract import Engine, Model, Run, Trajectory
from crosscheck.engines.conventions import rotation_matrix
from crosscheck.engines.linear.coordinates import coordinate_names
from crosscheck.engines.registry import engine
from flexmb.scene.hinges import Free, Spherical
from flexmb.scene.schema import Scene
from flexmb.typing import Real

Change = Callable[[dict[str, Real], Scene], dict[str, Real]]
Asks = Callable[[Scene], dict[str, Real]]


class Wrong:
    """The native engine, whose derivatives (T,n,n) and frequencies are changed."""

    name = "wrong"

    def __init__(self, change: Callable[[Trajectory, Scene, Asks], Trajectory]) -> None:
        self._native, self._change = engine("native"), change
        self.version, self.supports, self.efforts = self._native.version, self._native.supports, self._native.efforts
        self.takes = self._native.takes

    def compile(self, scene: Scene) -> Model:
        return WrongModel(self._native, scene, self._change)


class WrongModel:
    def __init__(self, native: Engine, scene: Scene, change: Callable[..., Trajectory]) -> None:
        self._native, self._scene, self._change = native, scene, change
        self._model = native.compile(scene)
        self.warm_up, self.evaluate = self._model.warm_up, self._model.evaluate

    def simulate(self, run: Run, effort: Any) -> Trajectory:
        def of(scene: Scene) -> dict[str, Real]:
            """The derivatives of another scene."""
            return self._native.compile(scene).simulate(run, effort).derivatives

        return self._change(self._model.simulate(run, effort), self._scene, of)


def matrices(*names: str, change: Callable[[Real, Scene], Real]) -> Callable[..., Trajectory]:
    """Every matrix (T,n,n) of these derivatives, by default of all, changed."""

    def changed(run: Trajectory, scene: Scene, of: Asks) -> Trajectory:
        n = len(coordinate_names(scene))
        derivatives = {
            name: change(values.reshape(-1, n, n), scene).reshape(len(values), -1)
            if name in names or not names else values
            for name, values in run.derivatives.items()
        }  # fmt: skip
        return replace(run, derivatives=derivatives)

    return changed


def frequencies(change: Callable[[Real], Real]) -> Callable[..., Trajectory]:
    def changed(run: Trajectory, scene: Scene, of: Asks) -> Trajectory:
        return replace(run, frequencies=None if run.frequencies is None else np.sort(change(run.frequencies), axis=1))

    return changed


def without_gravity(run: Trajectory, scene: Scene, of: Asks) -> Trajectory:
    """The derivatives of weightless motion: gravity taken for constant in body axes, or left out."""
    return replace(run, derivatives=of(msgspec.structs.replace(scene, gravity_m_s2=(0.0, 0.0, 0.0))))


def without_loads(run: Trajectory, scene: Scene, of: Asks) -> Trajectory:
    """Loads in World axes taken for loads that turn with their body."""
    loads = tuple(msgspec.structs.replace(load, frame="node") for load in scene.loads)
    return replace(run, derivatives=of(msgspec.structs.replace(scene, loads=loads)))


def coriolis_reversed(run: Trajectory, scene: Scene, of: Asks) -> Trajectory:
    """Terms of the speeds with the other sign, dampers as they are: what dampers give is left at rest."""
    hinges = tuple(
        msgspec.structs.replace(hinge, rotation=msgspec.structs.replace(hinge.rotation, rate_rad_s=0.0))
        for hinge in scene.hinges
    )
    at_rest = of(msgspec.structs.replace(scene, hinges=hinges))["by_speed"]
    by_speed = 2.0 * at_rest - run.derivatives["by_speed"]
    return replace(run, derivatives=run.derivatives | {"by_speed": by_speed})


def _turned(each: Real, scene: Scene) -> Real:
    """Columns of ball joints and of free flight in inboard axes."""
    names, found = coordinate_names(scene), each.copy()
    for hinge in scene.hinges:
        if isinstance(hinge, Spherical | Free):
            R = rotation_matrix(hinge.quaternion)
            for part in ("rotation", "position"):
                if f"{hinge.name}.{part}.x" in names:
                    first = names.index(f"{hinge.name}.{part}.x")
                    found[:, :, first : first + 3] = found[:, :, first : first + 3] @ R.T
    return found


def _linear_first(each: Real, scene: Scene) -> Real:
    names = coordinate_names(scene)
    (free,) = (hinge.name for hinge in scene.hinges if isinstance(hinge, Free))
    first = names.index(f"{free}.rotation.x")
    order = np.arange(len(names))
    order[first : first + 6] = np.roll(order[first : first + 6], 3)
    return each[:, order][:, :, order]


def _last_first(each: Real, scene: Scene) -> Real:
    return each[:, ::-1, ::-1]


def _modes_exchanged(each: Real, scene: Scene) -> Real:
    order = [*range(each.shape[1] - 2), each.shape[1] - 1, each.shape[1] - 2]
    return each[:, order][:, :, order]


TRANSPOSED = matrices(change=lambda each, scene: each.transpose(0, 2, 1))
WRONGS: dict[str, tuple[str, Callable[..., Trajectory]]] = {
    "transposed": ("derivatives-by-displacements", TRANSPOSED),
    "gravity left out": ("derivatives-by-displacements", without_gravity),
    "loads of World that turn": ("derivatives-by-displacements", without_loads),
    "of the other sign": ("derivatives-by-displacements", matrices(change=lambda each, scene: -each)),
    "speeds transposed": ("derivatives-by-speeds", TRANSPOSED),
    "Coriolis terms of the other sign": ("derivatives-by-speeds", coriolis_reversed),
    "the mass matrix itself": ("derivatives-by-forces", matrices(change=lambda each, scene: np.linalg.inv(each))),
    "the diagonal alone": ("derivatives-by-forces", matrices(change=lambda each, scene: each * np.eye(each.shape[1]))),
    "another order": ("derivatives-in-the-order-of-the-scene", matrices(change=_last_first)),
    "a ball in inboard axes": ("derivatives-by-rotations-of-a-ball", matrices(change=_turned)),
    "free flight in inboard axes": ("derivatives-in-free-flight", matrices(change=_turned)),
    "free flight with shifts first": ("derivatives-in-free-flight", matrices(change=_linear_first)),
    "modes in another order": ("derivatives-of-a-flexible-body", matrices(change=_modes_exchanged)),
    "Hz": ("frequencies-of-chains-of-springs", frequencies(lambda each: each / (2.0 * np.pi))),
    "squares": ("frequencies-of-chains-of-springs", frequencies(lambda each: each**2)),
    "each once": (
        "frequencies-of-chains-of-springs",
        frequencies(lambda each: np.hstack([each[:, ::2], 0.0 * each[:, ::2]])),
    ),
    "undamped": ("frequency-of-a-damped-pendulum", frequencies(lambda each: np.hypot(each, 0.9))),
    "moduli": ("frequencies-of-what-does-not-oscillate", frequencies(lambda each: each + np.array([0.0, 1.2, 0.0]))),
}


@pytest.mark.parametrize("wrong", WRONGS)
def test_what_is_wrong_breaks_a_clause(wrong: str) -> None:
    clause, change = WRONGS[wrong]
    found = try_clause(Wrong(change), CLAUSES[clause])
    assert found.status == "broken" and "where" in found.message, found


def test_a_row_of_a_prescribed_coordinate_breaks_a_clause() -> None:
    def with_all(run: Trajectory, scene: Scene, of: Asks) -> Trajectory:
        return replace(run, derivatives={key: np.tile(values, 2) for key, values in run.derivatives.items()})

    found = try_clause(Wrong(with_all), CLAUSES["derivatives-beside-a-prescribed-hinge"])
    assert found.status == "broken" and "belong to the coordinates to base.rotation, to end.rotation" in found.message


def test_an_engine_that_knows_too_little_of_its_derivatives_breaks_a_clause() -> None:
    def unsure(run: Trajectory, scene: Scene, of: Asks) -> Trajectory:
        return replace(run, known_to={name: np.full_like(values, np.inf) for name, values in run.known_to.items()})

    for clause in ("derivatives-by-speeds", "frequency-of-a-damped-pendulum"):
        assert "known to" in try_clause(Wrong(unsure), CLAUSES[clause]).message


def test_an_engine_without_derivatives_is_asked_for_them() -> None:
    def none(run: Trajectory, scene: Scene, of: Asks) -> Trajectory:
        return replace(run, derivatives={}, frequencies=None, known_to={})

    found = [try_clause(Wrong(none), clause) for clause in LINEARISED.clauses]
    assert {each.status for each in found} == {"not offered"}
    assert found[0].offer == "give derivatives by_displacement where a run asks for them"


@pytest.mark.parametrize("name", ["native", "pinocchio", "mujoco", "exudyn", "drake", "opensim"])
def test_engines_keep_the_clauses_on_derivatives(name: str) -> None:
    found = [try_clause(engine(name), clause) for clause in LINEARISED.clauses]
    if "missing" in {each.status for each in found}:
        pytest.skip(found[0].message)
    left = {each.clause for each in found if each.status != "holds"}
    without = {clause.name for clause in LINEARISED.clauses if clause.name.startswith("derivatives")}
    offered_not = {"native": set(), "exudyn": without}.get(name, {"derivatives-of-a-flexible-body"})
    assert left == offered_not and not any(each.status == "broken" for each in found), found


def test_every_clause_on_derivatives_has_its_mutant() -> None:
    tried = {clause for clause, _ in WRONGS.values()} | {"derivatives-beside-a-prescribed-hinge"}
    assert {clause.name for clause in LINEARISED.clauses} == tried
