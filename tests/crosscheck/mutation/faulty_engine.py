"""An engine whose adapter has a fault: another engine's answers, falsified."""

from dataclasses import dataclass

from crosscheck.engines.contract import Effort, Engine, Model, Run, Snapshot, Support, Trajectory
from crosscheck.engines.registry import engine
from crosscheck.mutation.answers import FAULTS, AnswerFault
from flexmb.scene.schema import Scene
from tests.crosscheck.fake_engines import engines as sound_engines


@dataclass
class FaultyModel:
    """A model that runs rightly and is read out wrongly."""

    model: Model
    scene: Scene
    fault: AnswerFault

    def warm_up(self) -> None:
        self.model.warm_up()

    def evaluate(self) -> Snapshot:
        raise NotImplementedError

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        return self.fault.falsify(self.model.simulate(run, effort), self.scene)


@dataclass
class FaultyEngine:
    """`engine` behind an adapter with one fault."""

    engine: Engine
    fault: AnswerFault

    @property
    def name(self) -> str:
        return self.fault.name

    def version(self) -> str:
        return self.engine.version()

    def supports(self, scene: Scene) -> Support:
        return self.engine.supports(scene)

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        return self.engine.efforts(scene)

    def compile(self, scene: Scene) -> Model:
        return FaultyModel(self.engine.compile(scene), scene, self.fault)


def engines() -> dict[str, Engine]:
    """The sound ones of the pendulum, and one for each fault."""
    sound = sound_engines()
    return {**sound, **{fault.name: FaultyEngine(sound["fine"], fault) for fault in FAULTS}}


def peers() -> dict[str, Engine]:
    """The native engine, and Pinocchio sound and with each fault: engines that have derivatives."""
    sound = {name: engine(name) for name in ("native", "pinocchio")}
    return {**sound, **{fault.name: FaultyEngine(sound["pinocchio"], fault) for fault in FAULTS}}
