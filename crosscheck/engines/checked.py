"""An engine whose answers are all held against the contract before anyone uses them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from crosscheck.engines.answers import checked_ladder, checked_model, checked_run, checked_support, checked_version
from crosscheck.engines.contract import USUAL_S, Effort, Engine, Model, Run, Snapshot, Support, Trajectory
from crosscheck.engines.total_loads import SceneWithPoints
from flexmb.scene.connectors import sticks
from flexmb.scene.schema import Scene, UserLaw

TOTAL_LOADS = "total_loads"
"""What an adapter names in `takes` that sums loads itself; for others it is done here."""
STICKING = "friction that sticks"
"""What an adapter names in `takes` that holds what friction holds; others have friction that is smooth through zero."""
LATER = ("connectors", "couplings", "controllers", "events")
"""Collections that scenes did not have when the contract was first written; `takes` names those an adapter handles."""
NO_START = "begins all runs at t = 0"


@dataclass
class CheckedEngine:
    """Asks an engine about runs that start at `t_start` and last `duration_s` (s).

    An answer that the contract does not allow raises `BrokenContract`; what the engine itself raises passes through.
    """

    engine: Engine
    t_start: float = 0.0
    duration_s: float = USUAL_S
    name: str = field(init=False)

    def __post_init__(self) -> None:
        self.name = self.engine.name

    def version(self) -> str:
        return checked_version(self.engine.version())

    def supports(self, scene: Scene) -> Support:
        """What the engine says; "no" where its adapter would silently ignore the start or a collection of the scene.

        User-defined controller laws are refused for every engine: records would not notice when they change.
        """
        known, scene = getattr(self.engine, "takes", ()), self._given(scene)
        if self.t_start != 0.0 and "t_start" not in known:
            return Support("no", f"the adapter of engine {self.name} {NO_START}")
        for collection in LATER:
            items = getattr(scene, collection)
            if items and collection not in known:
                return Support("no", f'"{items[0].name}": the adapter of engine {self.name} knows no {collection}')
        for connector in filter(sticks, scene.connectors):
            if STICKING not in known:
                return Support("no", f'"{connector.name}": friction of engine {self.name} is smooth, and never sticks')
        for law in scene.controllers:
            if isinstance(law, UserLaw) and not law.function.startswith("flexmb."):
                reason = f'the function "{law.function}" is not of flexmb: a record would not know its changes'
                return Support("no", reason)
        return checked_support(self.engine.supports(scene))

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        """The ladder for the duration from the engine's `efforts_for` if it has one, else its `efforts`."""
        scene = self._given(scene)
        if (by_duration := getattr(self.engine, "efforts_for", None)) is not None:
            return checked_ladder(by_duration(scene, self.duration_s))
        return checked_ladder(self.engine.efforts(scene))

    def compile(self, scene: Scene) -> Model:
        watched = self._watched(scene)
        given = scene if watched is None else watched.given
        return CheckedModel(checked_model(self.engine.compile(given)), given, watched)

    def _watched(self, scene: Scene) -> SceneWithPoints | None:
        """How total loads are found for an engine that sums no loads itself."""
        if not scene.total_loads or TOTAL_LOADS in getattr(self.engine, "takes", ()):
            return None
        return SceneWithPoints.of(scene)

    def _given(self, scene: Scene) -> Scene:
        """The scene that the engine gets."""
        watched = self._watched(scene)
        return scene if watched is None else watched.given


@dataclass(frozen=True)
class CheckedModel:
    """A compiled scene whose trajectories are checked; each run gets its own copy of the sample times. `watched`: how
    total loads are found where the engine sums none."""

    model: Model
    scene: Scene
    watched: SceneWithPoints | None = None

    def warm_up(self) -> None:
        self.model.warm_up()

    def evaluate(self) -> Snapshot:
        answer = self.model.evaluate()
        return answer if self.watched is None else self.watched.told(answer)

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        own = replace(run, times=run.times.copy())
        answer = checked_run(self.model.simulate(own, effort), run.times, self.scene)
        return answer if self.watched is None else self.watched.told(answer)
