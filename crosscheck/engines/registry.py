"""Which engines there are: the built-in adapters, and plug-ins from the entry-point group `crosscheck.engines`."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from importlib.metadata import entry_points

from crosscheck.engines.contract import Engine

GROUP = "crosscheck.engines"

BUILT_IN = {
    "native": "crosscheck.engines.native:NativeEngine",
    "native-composite": "crosscheck.engines.native:composite",
    "native-frisch": "crosscheck.engines.native:frisch",
    "native-frisch-as-printed": "crosscheck.engines.native:frisch_as_printed",
    "native-radau5": "crosscheck.engines.native:radau5",
    "native-exponential": "crosscheck.engines.native:exponential",
    "native-generalised-alpha": "crosscheck.engines.native:generalised_alpha",
    "pinocchio": "crosscheck.engines.pinocchio:PinocchioEngine",
    "mujoco": "crosscheck.engines.mujoco:MujocoEngine",
    "exudyn": "crosscheck.engines.exudyn:ExudynEngine",
    "exudyn-beam": "crosscheck.engines.exudyn:ExudynBeamEngine",
}
# Engines whose compiled code is another's: what that one leaves in caches on disk serves them too.
COMPILED_LIKE = {"native-frisch-as-printed": "native-frisch"}


def engines() -> dict[str, Engine]:
    """All engines by name, built-in ones first, whether or not their libraries are installed.

    An engine without its library raises `EngineMissing` from `version`. A plug-in may not take a built-in name.
    """
    found = {name: _load(path)() for name, path in BUILT_IN.items()}
    for point in entry_points(group=GROUP):
        if point.name in BUILT_IN:
            continue
        engine = point.load()()
        if not isinstance(engine, Engine):
            raise TypeError(f'entry point "{point.name}" of group "{GROUP}" is no crosscheck engine: {engine!r}')
        found[point.name] = engine
    return found


def engine(name: str) -> Engine:
    """One engine; KeyError names those there are."""
    known = engines()
    if name not in known:
        raise KeyError(f'no engine "{name}"; there are {", ".join(known)}')
    return known[name]


def _load(path: str) -> Callable[[], Engine]:
    module, _, name = path.partition(":")
    return getattr(import_module(module), name)
