"""The engine behind the contract's check: what it refuses in an adapter's place, and which ladder it asks for."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest

from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import Effort, Support
from crosscheck.library.find import load_case
from flexmb.scene.schema import Scene, UserLaw
from tests.crosscheck.fake_engines import COARSE, STEPS, Fake
from tests.crosscheck.sessions import CASE

LOADED = load_case(CASE)
SCENE = LOADED.scene(LOADED.run.variants[0])
OURS, FOREIGN = (
    UserLaw(name="law", inputs=(), function=function) for function in ("flexmb.control.laws:pd", "mine:pd")
)


@dataclass
class Taking(Fake):
    """A sound engine whose adapter says that it handles `takes`."""

    takes: tuple[str, ...] = ()

    def supports(self, scene: Scene) -> Support:
        return Support("surrogate", "asked")


@dataclass
class Lasting(Fake):
    """An engine whose efforts depend on the duration."""

    asked: list[tuple[Any, float]] = field(default_factory=list)

    def efforts_for(self, scene: Scene, duration_s: float) -> tuple[Effort, ...]:
        self.asked.append((scene, duration_s))
        return STEPS


def having(**collections: list[Any]) -> Any:
    """A scene as far as `supports` looks at it."""
    nothing = dict.fromkeys(("connectors", "couplings", "controllers", "events", "total_loads"), ())
    return SimpleNamespace(**nothing | collections)


def test_the_name_is_the_engines() -> None:
    assert CheckedEngine(Fake("fine")).name == "fine"


def test_an_adapter_that_ignores_the_start_is_refused_at_other_starts_alone() -> None:
    refusal = Support("no", "the adapter of engine fine begins all runs at t = 0")
    assert CheckedEngine(Fake("fine"), t_start=2.0).supports(having()) == refusal
    assert CheckedEngine(Fake("fine"), t_start=-2.0).supports(having()) == refusal
    assert CheckedEngine(Fake("fine")).supports(having()) == Support("exact")
    assert CheckedEngine(Taking("fine", takes=("t_start",)), t_start=2.0).supports(having()).reason == "asked"
    assert CheckedEngine(Taking("fine", takes=("events",)), t_start=2.0).supports(having()) == refusal


@pytest.mark.parametrize("collection", ["connectors", "couplings", "controllers", "events"])
def test_collections_of_which_an_adapter_does_not_speak_are_refused(collection: str) -> None:
    scene = having(**{collection: [SimpleNamespace(name="first"), SimpleNamespace(name="second")]})
    refusal = Support("no", f'"first": the adapter of engine fine knows no {collection}')
    assert CheckedEngine(Fake("fine")).supports(scene) == refusal
    others = tuple({"connectors", "couplings", "controllers", "events"} - {collection})
    assert CheckedEngine(Taking("fine", takes=others)).supports(scene) == refusal
    assert CheckedEngine(Taking("fine", takes=(collection,))).supports(scene).reason == "asked"


def test_a_law_from_elsewhere_is_refused_whatever_the_adapter_takes() -> None:
    engine = CheckedEngine(Taking("fine", takes=("controllers",)))
    assert engine.supports(having(controllers=[OURS])).reason == "asked"
    other = SimpleNamespace(name="pd")
    for laws in ([FOREIGN], [OURS, FOREIGN], [other, FOREIGN]):
        assert engine.supports(having(controllers=laws)) == Support(
            "no", 'the function "mine:pd" is not of flexmb: a record would not know its changes'
        )


def test_the_ladder_for_the_duration_comes_first() -> None:
    lasting = Lasting("fine", COARSE)
    assert CheckedEngine(lasting, duration_s=7.0).efforts(SCENE) == STEPS
    assert lasting.asked == [(SCENE, 7.0)]
    assert CheckedEngine(Fake("fine", COARSE)).efforts(SCENE) == COARSE
