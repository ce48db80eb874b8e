"""What outsiders got wrong in adapters: changes of the text of `small_adapter.py`, and scenes that are misread.

The changes of text are in `mutants.toml`. Scenes with flexible bodies are changed before flexmb sees them. `EQUIVALENT`
has the changes that change no answer, with the reason.
"""

import itertools
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from msgspec.structs import replace

from crosscheck.engines.contract import Engine, Model
from crosscheck.engines.registry import engine
from flexmb.scene.bodies import ModalBody
from flexmb.scene.schema import Scene

SOURCE = Path(__file__).with_name("small_adapter.py")
TABLE = Path(__file__).with_name("mutants.toml")


class Mutant(NamedTuple):
    """What is wrong, and the text that it replaces."""

    name: str
    old: str
    new: str


MUTANTS = [Mutant(name, **texts) for name, texts in tomllib.loads(TABLE.read_text(encoding="utf-8")).items()]
EQUIVALENT = {"the inertia transposed": "an inertia is symmetric: the transpose is the same tensor"}


def mutated(mutant: Mutant) -> Engine:
    """The small adapter with one change of its text; ValueError unless the text occurs once."""
    text = SOURCE.read_text(encoding="utf-8")
    if text.count(mutant.old) != 1:
        raise ValueError(f'"{mutant.name}": the text to change occurs {text.count(mutant.old)} times in {SOURCE.name}')
    name = f"small_adapter_{next(_NUMBERS)}"
    module = ModuleType(name)
    sys.modules[name] = module  # where dataclasses look for their own names
    try:
        exec(compile(text.replace(mutant.old, mutant.new), mutant.name, "exec"), module.__dict__)
    finally:
        del sys.modules[name]
    made: Engine = module.SmallEngine()
    return made


_NUMBERS = itertools.count()


class Misread:
    """flexmb with scenes of flexible bodies changed before it sees them: what an adapter reads wrongly."""

    name = "misread"

    def __init__(self, change: Callable[[Scene], Scene]) -> None:
        self._native, self._change = engine("native"), change
        self.version, self.supports, self.efforts = self._native.version, self._native.supports, self._native.efforts

    def compile(self, scene: Scene) -> Model:
        return self._native.compile(self._change(scene))


def _of_flexible(change: Callable[[ModalBody], Any]) -> Callable[[Scene], Scene]:
    def changed(scene: Scene) -> Scene:
        bodies = tuple(change(body) if isinstance(body, ModalBody) else body for body in scene.bodies)
        return replace(scene, bodies=bodies)

    return changed


def _nodes(**change: Callable[[Any], Any]) -> Callable[[Scene], Scene]:
    """Parts of all nodes of flexible bodies changed."""
    return _of_flexible(
        lambda body: replace(body, nodes=tuple(
            replace(node, **{part: function(getattr(node, part)) for part, function in change.items()})
            for node in body.nodes
        ))
    )  # fmt: skip


def _points(**change: Callable[[Any], Any]) -> Callable[[Scene], Scene]:
    return _of_flexible(
        lambda body: replace(body, points=tuple(
            replace(point, **{part: function(getattr(point, part)) for part, function in change.items()})
            for point in body.points
        ))
    )  # fmt: skip


def _states(**change: Callable[[Any], Any]) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, modal_states=tuple(
        replace(state, **{part: function(getattr(state, part)) for part, function in change.items()})
        for state in scene.modal_states
    ))  # fmt: skip


def _reversed(values: Any) -> Any:
    return tuple(reversed(values))


def _zero(values: Any) -> Any:
    return tuple(_zero(value) if isinstance(value, tuple) else 0.0 for value in values)


def _negative(values: Any) -> Any:
    return tuple(_negative(value) if isinstance(value, tuple) else -value for value in values)


def _diagonal(values: Any) -> Any:
    return tuple(tuple(v if i == j else 0.0 for j, v in enumerate(row)) for i, row in enumerate(values))


MISREADINGS: dict[str, Callable[[Scene], Scene]] = {
    "the order of the modes of nodes": _nodes(translation_modes=_reversed, rotation_modes=_reversed),
    "the order of the modes of points": _points(translation_modes=_reversed),
    "the order of the stiffness of modes": _of_flexible(
        lambda body: replace(body, stiffness=_reversed(tuple(map(_reversed, body.stiffness))))
    ),
    "the order of the initial modal coordinates": _states(coordinates=_reversed),
    "children on the undeformed node": _nodes(translation_modes=_zero, rotation_modes=_zero),
    "nodes that do not turn with the modes": _nodes(rotation_modes=_zero),
    "nodes that turn the other way": _nodes(rotation_modes=_negative),
    "modes of the other sign at nodes": _nodes(translation_modes=_negative),
    "the turn of a flexible body's node dropped": _nodes(quaternion=lambda _: (1.0, 0.0, 0.0, 0.0)),
    "stiffness on the diagonal alone": _of_flexible(lambda body: replace(body, stiffness=_diagonal(body.stiffness))),
    "damping of modes dropped": _of_flexible(lambda body: replace(body, damping=())),
    "initial modal coordinates dropped": _states(coordinates=_zero),
    "initial modal rates dropped": _states(rates=_zero),
    "a flexible body taken for a rigid one": _of_flexible(lambda body: replace(body, level="rigid")),
}
