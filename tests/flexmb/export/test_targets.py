"""Exported code for other processors, and pages that compute: WebAssembly against the scene itself, by wasmtime."""

from __future__ import annotations

import ctypes as ct
import importlib.util
import json
import os
import platform
import re
import struct
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import flexmb as fm
from flexmb.cli import app
from flexmb.export import web
from flexmb.export.emitted import LEVEL, TARGETS
from flexmb.export.model import ExportedModel, model
from flexmb.export.refusals import NotExportable
from flexmb.scene.files import dumps
from flexmb.scene.shapes import beam_section
from flexmb.typing import Real
from flexmb.view.page import SCRIPTS, asset
from tests.repo.project import ROOT

pytestmark = pytest.mark.skipif(
    platform.machine() != "x86_64" or os.name != "posix", reason="export is for Linux on x86-64"
)
STEP, T_END = 1e-3, 0.2
ROUNDING = 1e-11  # of a run of 200 steps: processors without fused multiply-add round each product
STIFFNESS = "shoulder.rotation.stiffness_Nm_rad"
MACHINES = {"aarch64": (2, 183), "armv7": (1, 40), "cortex-m7": (1, 40), "riscv64": (2, 243)}  # class and e_machine
LIBRARY = {"memcpy", "memset", "sin", "cos", "sincos", "exp", "expm1", "pow", "fmod", "nextafter", "tan", "atan2"}


def arm(stiffness: float = 3.0) -> fm.Scene:
    """An elastic arm on a sprung shoulder of a turning post, under gravity and a constant force."""
    scene = fm.SceneBuilder("arm", gravity=(0.0, 0.0, -9.81))
    scene.rigid_body("post", mass=2.0, inertia=(0.3, 0.4, 0.5))
    scene.beam("rod", length=0.6, elements=4, section=SECTION, modes=2)
    scene.revolute("yaw", "ground", "post", axis=(0, 0, 1), rate=1.5)
    scene.revolute("shoulder", "post", "rod", parent_position=(0.1, 0, 0), axis=(0, 1, 0), stiffness=stiffness)
    scene.force("hold", "rod", node="tip", direction=(0, 0, 1), function=fm.Constant(value=0.4))
    scene.marker("end", "rod", node="tip")
    return scene.scene()


SECTION = beam_section(E=7e9, G=2.7e9, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700)


@pytest.mark.parametrize("target", sorted(set(TARGETS) - {LEVEL, "wasm32"}))
def test_code_is_emitted_for_other_processors(target: str) -> None:
    """An object of the right kind, which needs nothing but a C library."""
    code = model(fm.SceneBuilder("p").rigid_body("b", mass=1.0, com=(0.5, 0, 0), inertia=(1, 1, 1))
                 .revolute("h", "ground", "b").scene(), target=target).code  # fmt: skip
    assert code[:4] == b"\x7fELF" and (code[4], struct.unpack_from("<H", code, 18)[0]) == MACHINES[target]
    missing = {name for name in _undefined(code) if not name.startswith("__")}  # and the compiler's own library
    assert missing <= LIBRARY


def test_another_target_is_refused_with_the_nearest(tmp_path: Path) -> None:
    refused = CliRunner().invoke(app, ["export", str(_file(tmp_path)), "--c", str(tmp_path), "--target", "cortex-m"])
    assert refused.exit_code == 2 and 'did you mean "cortex-m7"' in refused.output


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--slider", "rod.mas=1,2"], "is no input or parameter of the model"),
        (["--slider", f"{STIFFNESS}=2,1"], "the lesser first"),
        (["--slider", f"{STIFFNESS}=nan,1"], "the lesser first"),
        (["--slider", "shoulder.rotation.rest_rad"], "give its range"),
        (["--slider", f"{STIFFNESS}=1"], "two numbers"),
        (["--step", "0"], "give a positive one"),
    ],
)
def test_a_page_says_what_is_wrong_with_what_it_is_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ready: ExportedModel, words: list[str], said: str
) -> None:
    monkeypatch.setattr(web, "model", lambda *_, **__: ready)
    monkeypatch.setattr(web, "compiler", lambda: ["true"])
    page = tmp_path / "page.html"
    refused = CliRunner().invoke(app, ["export", str(_file(tmp_path)), "--page", str(page), *words])
    assert (refused.exit_code, said in " ".join(refused.output.split())) == (2, True), refused.output
    assert not page.exists()


def test_a_page_without_its_compiler_is_refused_before_anything_is_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(web, "find_spec", lambda _: None)
    with pytest.raises(NotExportable, match="pip install ziglang"):
        web.export_page(arm(), tmp_path / "page.html")


@pytest.fixture(scope="module")
def ready() -> ExportedModel:
    return model(web._filmed(arm()), target="wasm32")


class Module:
    """A module of WebAssembly, run by wasmtime."""

    def __init__(self, code: bytes, made_of: ExportedModel) -> None:
        wasmtime = pytest.importorskip("wasmtime")
        store = wasmtime.Store()
        module = wasmtime.Module(store.engine, code)
        assert not module.imports  # it reaches nothing outside of itself
        exports = wasmtime.Instance(store, module, []).exports(store)
        self.call = lambda name, *values: exports[name](store, *values)
        base = ct.addressof(exports["memory"].data_ptr(store).contents)
        self.call("initialise")
        self.state = self._numbers(base + self.call("states"), len(made_of.states))
        self.output = self._numbers(base + self.call("outputs"), len(made_of.outputs))

    @staticmethod
    def _numbers(address: int, count: int) -> Real:
        return np.ctypeslib.as_array((ct.c_double * count).from_address(address))


@pytest.fixture(scope="module")
def code(ready: ExportedModel) -> bytes:
    if importlib.util.find_spec("ziglang") is None:
        pytest.skip("ziglang is not installed: the extra `web` has it")
    return web.wasm(ready)


def test_web_assembly_moves_as_the_scene_does(code: bytes, ready: ExportedModel) -> None:
    """By equal steps of the same method, before and after a number is changed: the scene with that number."""
    module = Module(code, ready)
    names = [each.name for each in ready.outputs]
    places = [names.index(f"end.position.{axis}") for axis in "xyz"]
    number = [each.candidate.name for each in ready.numbers.changeable].index(STIFFNESS)
    ends = []
    for stiffness in (3.0, 5.0):
        module.call("change", number, stiffness)
        assert module.call("begin", 0.0) == 0
        assert module.call("advance", T_END, STEP) == 0 and module.call("reached") == T_END
        assert module.call("observe") == 0
        run = fm.simulate(arm(stiffness), T_END, samples=2, method="rk4", step=STEP)
        assert np.max(np.abs(module.output[places] - run.markers["end"].position[-1])) < ROUNDING
        scale = np.max(np.abs(run.u))
        assert np.max(np.abs(module.state[:-1] - np.concatenate([run.q[-1], run.u[-1]]))) < ROUNDING * scale
        ends.append(module.output[places].copy())
    assert np.max(np.abs(ends[0] - ends[1])) > 1e6 * ROUNDING  # the number is not without effect
    assert len(code) < 300_000


def test_the_page_is_one_file_with_its_model(code: bytes, ready: ExportedModel, tmp_path: Path) -> None:
    text = web._page(arm(), web._filmed(arm()), ready, web._sliders(ready, {STIFFNESS: (0.0, 9.0)}), STEP)
    assert len(text) < 1_000_000
    assert not re.search(r"(src|href)=\"?(https?:)?//", text)
    found = re.search(r'id="data">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    data: dict[str, Any] = json.loads(found[1])
    assert (data["step"], data["digest"], data["states"]) == (STEP, ready.digest, len(ready.states))
    assert [(each["name"], each["low"], each["high"]) for each in data["sliders"]] == [(STIFFNESS, 0.0, 9.0)]


def test_sliders_are_springs_and_inputs_first(ready: ExportedModel) -> None:
    names = [ready.numbers.changeable[i].candidate.name for i, _ in web._sliders(ready, None)]
    assert set(names[:2]) == {STIFFNESS, "hold.force"} and len(names) <= web.SHOWN


def test_the_step_is_stable(ready: ExportedModel) -> None:
    """0.8 of what the fastest mode turns in a radian, and never longer than a quarter of a frame."""
    fastest = np.abs(fm.linearize(arm()).eigenvalues).max()
    assert web._step(arm()) == min(web.FRAME_S, web.STABLE / fastest) < 2.78 / fastest
    free = fm.SceneBuilder("p").rigid_body("b", mass=1.0, inertia=(1, 1, 1)).free("f", "ground", "b").scene()
    assert web._step(free) == web.FRAME_S


def test_the_demonstration_of_the_site_is_of_the_present_scene() -> None:
    """docs/_static/yoke_array.html is made by the command that docs/export-fmu.md shows."""
    text = (ROOT / "docs" / "_static" / "yoke_array.html").read_text(encoding="utf-8")
    scene = web._filmed(fm.load_scene(ROOT / "cases" / "spacecraft" / "yoke_array" / "scene.toml"))
    digest = sha256(dumps(scene).encode()).hexdigest()
    assert f'"digest":"{digest}"' in text and len(text) < 1_000_000
    assert all(asset(name) in text for name in ("live.js", *SCRIPTS)), "draw it anew: its scripts have changed"


def _file(folder: Path) -> Path:
    file = folder / "arm.toml"
    fm.save_scene(arm(), file)
    return file


def _undefined(code: bytes) -> set[str]:
    """Names of undefined symbols of an ELF object, little-endian, of 32 or 64 bits."""
    wide = code[4] == 2
    at, size, count = (
        (struct.unpack_from("<Q", code, 40)[0], *struct.unpack_from("<HH", code, 58)) if wide
        else (struct.unpack_from("<I", code, 32)[0], *struct.unpack_from("<HH", code, 46))
    )  # fmt: skip
    heads = [struct.unpack_from("<IIQQQQIIQQ" if wide else "<IIIIIIIIII", code, at + i * size) for i in range(count)]
    found = set[str]()
    for head in heads:
        if head[1] != 2:  # a table of symbols
            continue
        start, names = head[4], heads[head[6]][4]
        for place in range(start, start + head[5], head[9]):
            name, where = (
                (struct.unpack_from("<I", code, place)[0], struct.unpack_from("<H", code, place + 6)[0]) if wide
                else (struct.unpack_from("<I", code, place)[0], struct.unpack_from("<H", code, place + 14)[0])
            )  # fmt: skip
            if where == 0 and name:
                found.add(code[names + name : code.index(b"\0", names + name)].decode())
    return found
