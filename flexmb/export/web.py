"""A scene as a page of the web that computes: its equations as WebAssembly, drawn as `flexmb view` draws.

The page is one file without network. What it computes is what the exported C computes (`flexmb.export.model`), by the
method "rk4" in equal steps; the reader changes inputs and parameters while it runs.
"""

from __future__ import annotations

import base64
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from math import inf, isfinite
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from flexmb.export.model import ExportedModel, model
from flexmb.export.numbers import Changeable
from flexmb.export.refusals import NotExportable, refuse
from flexmb.export.sources import browser, core, header
from flexmb.interchange.sid.to_body import with_sid_bodies
from flexmb.linear.linearize import linearize
from flexmb.output.files import folder, write_whole
from flexmb.output.printable import printable
from flexmb.scene.problems import closest
from flexmb.scene.schema import Marker, Scene
from flexmb.view.draw import draw
from flexmb.view.drawing import CarriedPoint, Line, carried_line, carriers
from flexmb.view.film import hung, marked
from flexmb.view.page import SCRIPTS, filled, html_file

FLAGS = ("-target", "wasm32-wasi", "-mexec-model=reactor", "-std=gnu11", "-O2", "-g0", "-Wl,--strip-all")
FRAME_S = 1.0 / 240.0  # the longest step: a quarter of a frame of a screen
STABLE = 0.8
"""Step times the fastest natural frequency (rad/s): the method is stable up to 2.8, and sliders may stiffen a scene."""
READINGS = "energy.kinetic", "energy.total"
SHOWN = 8  # sliders, if none are named: inputs and gains first
GAINS = ".stiffness_", ".damping_"
RANGE = 0.1, 3.0  # of a slider, times the number's value in the scene
SPAN_S = 5.0  # of motion that the camera is placed for

Range = tuple[float, float]


def export_page(
    scene: Scene, path: Path, *, sliders: Mapping[str, Range | None] | None = None, inputs: Sequence[str] = (),
    step: float | None = None,
) -> ExportedModel:  # fmt: skip
    """Write a scene as one HTML page that computes its motion in the browser; returns the model.

    sliders: the range of each number that the reader changes, by its name in the model (an input or a parameter, in the
    scene's units; None: from 0.1 to 3 times its value); by default eight that are not zero, inputs, springs and dampers
    first. inputs: as of `export_fmu`. step (s): of the method "rk4", by default 0.8 over the fastest natural frequency
    (rad/s) of the scene at its start, at most 1/240 s.

    Raises NotExportable, before anything is compiled, for what `export_fmu` refuses and where the compiler ziglang is
    not installed; ValueError for a slider that is no number of the model or has no range, for a step that is not
    positive or cannot be found, or a path that does not end in .html; SceneError for a scene that is wrong; OSError
    where the file cannot be written.
    """
    file = html_file(path)
    if step is not None and not 0.0 < step < inf:
        raise ValueError(f"step is {step:g} s: give a positive one, or leave it out")
    compiler()
    refuse(scene)
    filmed = _filmed(scene)
    taken = step or _step(scene)
    made_of = model(filmed, inputs, target="wasm32")
    chosen = _sliders(made_of, sliders)
    text = _page(scene, filmed, made_of, chosen, taken)
    folder(file.parent)
    write_whole(file, text)
    return made_of


def compiler() -> list[str]:
    """The command of a C compiler for WebAssembly, the package ziglang; NotExportable if it is not installed."""
    if find_spec("ziglang") is None:
        raise NotExportable(
            "a page that computes needs a compiler to WebAssembly, the package ziglang (100 MB), which is not "
            "installed: pip install ziglang; `flexmb view` writes a page of a run without it"
        )
    return [sys.executable, "-m", "ziglang", "cc"]


def wasm(model: ExportedModel) -> bytes:
    """The module of a model that was made for "wasm32": it imports nothing; functions as in `c/page.c`."""
    with tempfile.TemporaryDirectory() as place:
        work = Path(place)
        write_whole(work / f"{model.identifier}.h", header(model))
        write_whole(work / "model.c", core(model) + "\n" + browser(model))
        write_whole(work / "kernels.o", model.code)
        command = [*compiler(), *FLAGS, "-o", "model.wasm", "model.c", "kernels.o", "-lm"]
        done = subprocess.run(command, cwd=work, capture_output=True, text=True, errors="replace")
        if done.returncode:
            said = done.stderr.strip().splitlines()
            last = next((line for line in said if "error" in line), (said or ["no message"])[-1])
            raise NotExportable(f"ziglang could not make the module; was another version tested? {last}")
        return (work / "model.wasm").read_bytes()


def _filmed(scene: Scene) -> Scene:
    """The scene with markers on all that is drawn, its hinges included."""
    filmed = marked(hung(with_sid_bodies(scene)))
    joints = tuple(
        Marker(
            name=_joint(hinge.name), body=hinge.child, node=hinge.child_node, offset_m=hinge.child_position_m
        )  # in the axes of the node; the drawing needs the place alone
        for hinge in filmed.hinges
    )
    return msgspec.structs.replace(filmed, markers=(*filmed.markers, *joints))


def _joint(hinge: str) -> str:
    return f"joint {hinge}"


def _step(scene: Scene) -> float:
    """A stable step (s), by the linear model at the start."""
    try:
        fastest = float(np.abs(linearize(scene).eigenvalues).max(initial=0.0))
    except (ValueError, NotImplementedError, ArithmeticError, RuntimeError) as problem:
        raise ValueError(f"give a step, for the linear model at the start does not tell it: {problem}") from problem
    return min(FRAME_S, STABLE / fastest) if fastest > 0.0 else FRAME_S


def _sliders(model: ExportedModel, asked: Mapping[str, Range | None] | None) -> list[tuple[int, Range]]:
    """Numbers of the model with their ranges."""
    numbers = {each.candidate.name: (i, each) for i, each in enumerate(model.numbers.changeable)}
    if asked is None:
        able = [each for _, each in numbers.values() if each.value != 0.0 and not each.candidate.is_prescribed]
        able.sort(key=lambda each: not (each.candidate.is_input or any(gain in each.candidate.name for gain in GAINS)))
        asked = dict.fromkeys(each.candidate.name for each in able[:SHOWN])
    found = list[tuple[int, Range]]()
    for name, given in asked.items():
        if name not in numbers:
            why = model.numbers.fixed.get(name)
            remedy = f"it is fixed: {why}" if why else closest(name, numbers)
            raise ValueError(f'slider "{name}" is no input or parameter of the model: {remedy}')
        i, each = numbers[name]
        found.append((i, given or _range(each)))
        low, high = found[-1][1]
        if not (isfinite(low) and isfinite(high) and low < high):
            raise ValueError(f'slider "{name}" has the range {low:g} to {high:g}: give two numbers, the lesser first')
    return found


def _range(number: Changeable) -> Range:
    if number.value == 0.0:
        raise ValueError(f'slider "{number.candidate.name}" is 0 in the scene: give its range, NAME=LOW,HIGH')
    low, high = sorted(factor * number.value for factor in RANGE)
    return low, high


def _page(scene: Scene, filmed: Scene, model: ExportedModel, sliders: list[tuple[int, Range]], step: float) -> str:
    outputs = {each.name: i for i, each in enumerate(model.outputs)}
    drawing = draw(filmed, trails=[marker.name for marker in scene.markers])
    joints = tuple(
        Line(body=hinge.name, kind="joint", points=(CarriedPoint(_joint(hinge.name), (0.0, 0.0, 0.0)),))
        for hinge in filmed.hinges
    )
    carrying = list(dict.fromkeys((*carriers(drawing), *(_joint(hinge.name) for hinge in filmed.hinges))))
    number = {name: i for i, name in enumerate(carrying)}
    states = {each.name: i for i, each in enumerate(model.states)}
    data: dict[str, Any] = {
        "digest": model.digest, "step": step, "span": SPAN_S,
        "notes": [f"No arrows: {model.open_loads}."] if model.open_loads else [],
        "states": len(model.states), "outputs": len(model.outputs), "gravity": filmed.gravity_m_s2,
        "wasm": base64.b64encode(wasm(model)).decode(),
        "markers": [
            {"name": name, "position": outputs[f"{name}.position.x"], "rotation": outputs[f"{name}.rotation[1,1]"]}
            for name in carrying
        ],
        "lines": [carried_line(line, number) for line in (*drawing.lines, *joints)],
        "wheels": [
            {
                "name": wheel.name, "marker": number[wheel.marker], "centre": wheel.centre, "axis": wheel.axis,
                "radius": wheel.radius_m, "width": wheel.width_m, "state": states[f"{wheel.name}.angle"],
            }
            for wheel in drawing.wheels
        ],
        "trails": [number[name] for name in drawing.trails],
        "arrows": [
            {"name": hinge.name, "kind": kind, "marker": number[_joint(hinge.name)], "output": outputs[first]}
            for hinge in filmed.hinges
            for kind in ("force", "torque")
            if (first := f"{hinge.name}.{kind}.x") in outputs
        ],
        "sliders": [
            {
                "number": i, "name": printable(model.numbers.changeable[i].candidate.name),
                "unit": model.numbers.changeable[i].candidate.unit, "value": model.numbers.changeable[i].value,
                "low": low, "high": high, "again": model.numbers.changeable[i].candidate.is_prescribed,
            }
            for i, (low, high) in sliders
        ],
        "readings": [{"name": name, "unit": "J", "output": outputs[name]} for name in READINGS],
    }  # fmt: skip
    return filled("view.html", scene.name, (*SCRIPTS, "live.js"), data)
