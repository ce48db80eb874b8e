"""Engines are found by name, built in or plugged in, and a missing library says how to get it."""

import sys
from importlib.metadata import EntryPoint

import pytest

from crosscheck.engines import registry
from crosscheck.engines.contract import EngineMissing


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
    with pytest.raises(registry.NoSuchEngine, match="native-generalised-alpha, native-radau5, pinocchio"):
        registry.engine("abaqus")


def test_plug_in_is_found(monkeypatch):
    _plug(monkeypatch, "mine", f"{__name__}:_Plugged")
    assert registry.engine("mine").name == "plugged"


def test_plug_in_that_is_no_engine_is_refused(monkeypatch):
    _plug(monkeypatch, "mine", f"{__name__}:_NoEngine")
    broken = registry.engines()["mine"]
    with pytest.raises(registry.BrokenPlugIn, match="no crosscheck engine.*without name, version"):
        broken.version()


@pytest.mark.parametrize(("name", "package"), [("pinocchio", "pin"), ("mujoco", "mujoco")])
def test_missing_library_names_what_pip_finds(monkeypatch, name, package):
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(EngineMissing, match=f"pip install {package}$"):
        registry.engine(name).version()
