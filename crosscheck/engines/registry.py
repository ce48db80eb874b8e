"""Which engines there are: the built-in adapters, plug-ins from the entry-point group `crosscheck.engines`, and any FMU
by the name "fmu:FILE".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING

from crosscheck.engines.unusable import Unusable
from flexmb.scene.problems import closest

if TYPE_CHECKING:  # names are looked up before anything that runs engines is imported
    from crosscheck.engines.contract import Effort, Engine, Model, Support
    from flexmb.scene.schema import Scene

PROVIDER = "crosscheck.engines.registry:engines"
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
    "drake": "crosscheck.engines.drake:DrakeEngine",
    "dart": "crosscheck.engines.dart:DartEngine",
    "basilisk": "crosscheck.engines.basilisk:BasiliskEngine",
    "opensim": "crosscheck.engines.opensim:OpensimEngine",
    "kratos": "crosscheck.engines.kratos:KratosEngine",
    "kane": "crosscheck.engines.kane:KaneEngine",
}
FMU = "fmu:"
"""What the name of an engine begins with that is an FMU, or a mapping of one; the rest is its file."""
FMU_ENGINE = "crosscheck.engines.fmu:FmuEngine"
OWN_CODE = tuple(name for name, place in BUILT_IN.items() if place.startswith("crosscheck.engines.native:"))
# For each engine the one whose library or compiled code it shares: both run in the same worker process.
SERVED_WITH = dict.fromkeys(OWN_CODE, "native") | {"exudyn-beam": "exudyn"}


class Engines(Mapping[str, "Engine"]):
    """Engines by name, each loaded on first use; besides those that it lists, every FMU by its file."""

    def __init__(self, loaders: dict[str, Callable[[], Engine]]) -> None:
        self._loaders = loaders

    def __getitem__(self, name: str) -> Engine:
        return _fmu(name) if is_fmu(name) else self._loaders[name]()

    def __iter__(self) -> Iterator[str]:
        return iter(self._loaders)

    def __len__(self) -> int:
        return len(self._loaders)

    def __contains__(self, name: object) -> bool:
        return name in self._loaders or (isinstance(name, str) and is_fmu(name))


class NoSuchEngine(LookupError):
    """The provider has no engine of this name; the message names the nearest."""


class BrokenPlugIn(Unusable):
    """A plug-in that cannot be used; the message names it and says why."""


class Broken:
    """Stands for a plug-in that cannot be loaded: every call raises the reason."""

    summary = ""

    def __init__(self, name: str, error: Exception) -> None:
        self.name = name
        self._error = error

    def version(self) -> str:
        raise self._error

    def supports(self, scene: Scene) -> Support:
        raise self._error

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        raise self._error

    def compile(self, scene: Scene) -> Model:
        raise self._error


def engines() -> Engines:
    """All engines by name, built-in ones first, whether or not their libraries are installed.

    An engine without its library raises `EngineMissing` from `version`, and so does a plug-in that cannot be imported.
    A plug-in that cannot be loaded for another reason raises `BrokenPlugIn`. Built-in names take precedence.
    """
    providers: dict[str, Callable[[], Engine]] = {name: partial(_built_in, path) for name, path in BUILT_IN.items()}
    for name, points in _plug_ins().items():
        providers[name] = partial(_plugged, name, points)
    return Engines(providers)


def plug_ins() -> tuple[str, ...]:
    """Names of the engines from the entry points of other distributions."""
    return tuple(_plug_ins())


def is_fmu(name: str) -> bool:
    """Whether an engine's name is that of an FMU by its file."""
    return name.startswith(FMU) and len(name) > len(FMU)


def home(name: str) -> str:
    """The module that makes the engine called `name`, "" if there is no such engine."""
    if is_fmu(name):
        return FMU_ENGINE.partition(":")[0]
    paths = [BUILT_IN[name]] if name in BUILT_IN else [point.value for point in _plug_ins().get(name, ())]
    return paths[0].partition(":")[0].strip() if len(paths) == 1 else ""


def engine(name: str) -> Engine:
    """One engine; NoSuchEngine if it is not known."""
    return find_engine(PROVIDER, name)


def find_engine(provider: str, name: str) -> Engine:
    """The engine called `name` of a provider "module:function"; no other engine is loaded. Raises NoSuchEngine."""
    return known_engine(provider, name)[name]


def known_engine(provider: str, name: str) -> Mapping[str, Engine]:
    """The engines of a provider, none of them loaded; NoSuchEngine unless one is called `name`."""
    module, _, function = provider.partition(":")
    engines: Mapping[str, Engine] = getattr(import_module(module), function)()
    if name not in engines:
        raise NoSuchEngine(f'there is no engine "{name}": {closest(name, engines)}')
    return engines


def _built_in(path: str) -> Engine:
    module, _, name = path.partition(":")
    made: Engine = getattr(import_module(module), name)()
    return made


def _fmu(name: str) -> Engine:
    module, _, kind = FMU_ENGINE.partition(":")
    made: Engine = getattr(import_module(module), kind)(name)
    return made


def _plug_ins() -> dict[str, list[EntryPoint]]:
    """Entry points by name, several if several distributions use the same name."""
    points: dict[str, list[EntryPoint]] = {}
    for point in entry_points(group=GROUP):
        if point.name not in BUILT_IN and point not in points.setdefault(point.name, []):
            points[point.name].append(point)
    return points


def _plugged(name: str, points: list[EntryPoint]) -> Engine:
    """The engine of a plug-in, or a `Broken` one with the reason."""
    from crosscheck.engines.contract import Engine, EngineMissing

    what = f'plug-in "{name}" ({", ".join(point.value for point in points)})'
    if len(points) > 1:
        return Broken(name, BrokenPlugIn(f"{what}: several distributions offer this name; uninstall all but one"))
    try:
        made = points[0].load()()
    except ImportError as error:
        return Broken(name, EngineMissing(f"{what} cannot be imported: {type(error).__name__}: {error}"))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a broken plug-in, even one that calls sys.exit, must not affect other engines
        return Broken(name, BrokenPlugIn(f"{what} cannot be loaded: {type(error).__name__}: {error}"))
    if not isinstance(made, Engine):
        lacking = f"it made a {type(made).__name__} without {_lacking(made)}"
        return Broken(name, BrokenPlugIn(f"{what} is no crosscheck engine: {lacking}"))
    return made


def _lacking(made: object) -> str:
    """The members of the contract that an object lacks."""
    return ", ".join(word for word in ("name", "version", "supports", "efforts", "compile") if not hasattr(made, word))
