"""Engines are found by name, built in or plugged in, and a missing library says how to get it."""

import re
import sys
import tomllib
from importlib.metadata import EntryPoint

import pytest

from crosscheck.engines import registry
from crosscheck.engines.contract import EngineMissing
from tests.repo.project import ROOT


class _Plugged:
    name = "plugged"

    def version(self):
        return "1"

    def supports(self, scene):
        raise NotImplementedError

    efforts = compile = supports


class _NoEngine:
    pass


def _plug(monkeypatch, name: str, value: str) -> None:
    points = [EntryPoint(name=name, value=value, group=registry.GROUP)]
    monkeypatch.setattr(registry, "entry_points", lambda group: points)


def test_built_in_engines_are_found_under_their_names():
    found = registry.engines()
    assert tuple(found)[: len(registry.BUILT_IN)] == tuple(registry.BUILT_IN)
    assert {"native", "native-composite", "native-frisch", "native-frisch-as-printed"} <= found.keys()
    assert all(engine.name == name for name, engine in found.items())


def test_unknown_name_lists_the_known_ones():
    with pytest.raises(registry.NoSuchEngine, match="native-generalised-alpha, native-radau5, opensim, pinocchio"):
        registry.engine("abaqus")


def test_plug_in_is_found(monkeypatch):
    _plug(monkeypatch, "mine", f"{__name__}:_Plugged")
    assert registry.engine("mine").name == "plugged"


def test_plug_in_that_is_no_engine_is_refused(monkeypatch):
    _plug(monkeypatch, "mine", f"{__name__}:_NoEngine")
    broken = registry.engines()["mine"]
    with pytest.raises(registry.BrokenPlugIn, match="no crosscheck engine.*without name, version"):
        broken.version()


LIBRARIES = [
    ("pinocchio", "pinocchio", "pin"), ("mujoco", "mujoco", "mujoco"), ("drake", "pydrake", "drake"),
    ("dart", "dartpy", "dartpy"), ("basilisk", "Basilisk", "bsk"), ("opensim", "opensim", "opensim"),
    ("kratos", "KratosMultiphysics", "KratosStructuralMechanicsApplication"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "module", "package"), LIBRARIES)
def test_missing_library_names_what_pip_finds(monkeypatch, name, module, package):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(EngineMissing, match=f"pip install {package}$"):
        registry.engine(name).version()


def test_remedies_are_the_distributions_of_the_extras() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    ours = ("peers", "more-peers", "opensim", "kratos")
    known = {re.split(r"[^\w-]", requirement)[0] for name in ours for requirement in extras[name]}
    assert {package for *_, package in LIBRARIES} == known - {"exudyn"}, "Exudyn's is tried beside its engines"
    foreign = set(registry.BUILT_IN) - set(registry.OWN_CODE)
    without_library = {"kane", "exudyn", "exudyn-beam"}  # the first was written for crosscheck
    assert {name for name, *_ in LIBRARIES} == foreign - without_library
