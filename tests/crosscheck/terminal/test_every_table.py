"""What commands print as tables is whole: in a pipe line by line, on a narrow terminal word by word."""

import json
import os
import pty
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from crosscheck.library.find import load_case
from flexmb.scene.build import SceneBuilder
from flexmb.scene.files import save_scene
from flexmb.scene.shapes import beam_section
from tests.crosscheck.fake_project import fake_project

PANEL = "panel_whose_name_is_longer_than_a_terminal_of_forty_columns"
DRIVER = Path(__file__).with_name("every_table.py")
PLAIN = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
MEASURED = re.compile(r"\d[^ ]* (s|ms|us)\b|[+-]?\d[\d.e+%-]*")  # times differ from run to run


def spinner(folder: Path) -> Path:
    """A hub that spins, with a flexible panel."""
    section = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=9e-10, rho=2700.0)
    scene = (
        SceneBuilder("spinner")
        .rigid_body("hub", mass=5.0, inertia=(1.0, 1.2, 1.5))
        .beam(PANEL, length=1.0, elements=4, section=section, modes=3)
        .revolute("shaft", "ground", "hub", rate=1.0)
        .weld("root", "hub", PANEL)
        .marker("tip", PANEL, node="tip")
        .scene()
    )
    file = folder / "spinner.toml"
    save_scene(scene, file)
    return file


def cheap(folder: Path) -> list[list[str]]:
    """Commands that need no kernel and run no session."""
    return [
        ["crosscheck", "list"],
        ["crosscheck", "stability", "list"],
        ["flexmb", "equivalence", str(spinner(folder)), PANEL, "--picture", str(folder / "equivalence.png")],
    ]


def dear(folder: Path) -> list[list[str]]:
    """Commands that compile, and those that run engines again and again, or search."""
    scene = str(spinner(folder))
    case, out = str(fake_project(folder) / "pendulum" / "single"), str(folder / "out")
    csv = load_case(Path(case)).folder / "reference.csv"
    sweep = folder / "spread.toml"
    sweep.write_text(SWEEP, encoding="utf-8")
    return [
        ["crosscheck", "engines"], ["flexmb", "mass", scene], ["flexmb", "linearize", scene, "--at", "initial"],
        ["flexmb", "campbell", scene, "shaft", "--rates", "0:4:3", "--picture", str(folder / "campbell.png")],
        ["flexmb", "vibrate", scene, "--at", "initial"],
        ["flexmb", "simulate", scene, "--t-end", "0.1", "--error-estimate", "--no-plots", "--out", str(folder / "out")],
        ["crosscheck", "run", case, "-e", "native", "--verbose", "--fresh", "--out", out],
        ["crosscheck", "verify", case, str(csv)], ["crosscheck", "bench", case, "-e", "native", "--rounds", "1"],
        ["crosscheck", "mutate", case, "--out", out], ["crosscheck", "invariance", case, "--out", out],
        ["crosscheck", "sweep", str(sweep), "--out", out],
        ["flexmb", "advise", str(spinner(folder)), "--t-end", "0.1", "--out", str(folder / "advised.toml")],
    ]  # fmt: skip


SWEEP = """
title = "A hub whose mass is uncertain"
case = "wheel_gyrostat/torque_free"
engines = ["native"]
efforts = [{ engine = "native", kind = "tolerance", method = "dop853", value = 1e-6 }]
number = 4
seed = 7

[[parameter]]
name = "mass"
path = "bodies.*.mass_kg"
relative = true
distribution = "normal"
mean = 1.0
sd = 0.01

[[quantity]]
name = "a_quantity_whose_name_is_longer_than_a_terminal_of_forty_columns"
channel = "momentum.angular"
component = "z"
value = "final"
"""


def in_a_pipe(commands: Path, **environment: str) -> str:
    words = [sys.executable, str(DRIVER), str(commands)]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=os.environ | environment)
    return done.stdout


def on_a_terminal(commands: Path, columns: int, **environment: str) -> str:
    """What a terminal of so many columns is sent."""
    parent, child = pty.openpty()
    os.set_blocking(parent, True)
    subprocess.run(["stty", "cols", str(columns), "rows", "25"], stdin=child, check=True)
    inherited = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "NO_COLOR")}
    process = subprocess.Popen(
        [sys.executable, str(DRIVER), str(commands)], stdin=child, stdout=child, stderr=subprocess.DEVNULL,
        env=inherited | {"TERM": "xterm-256color"} | environment,
    )  # fmt: skip
    os.close(child)
    sent = bytearray()
    try:
        while piece := os.read(parent, 65536):
            sent += piece
    except OSError:  # Linux says so that nobody writes any more
        pass
    finally:
        os.close(parent)
    assert process.wait() == 0
    return sent.decode().replace("\r\n", "\n")


def unmeasured(text: str) -> str:
    """Without figures, which may be times, and rules, whose lengths follow what stands above them."""
    return re.sub(r"[─ ]+|:\s", " ", MEASURED.sub("", PLAIN.sub("", text)))


@pytest.mark.parametrize("commands", [cheap, pytest.param(dear, marks=[pytest.mark.slow])])
def test_nothing_is_cut_or_folded(
    commands: Callable[[Path], list[list[str]]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a pipe COLUMNS does not count; on a terminal of 40 columns every word of the pipe appears in one piece."""
    made = commands(tmp_path)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *sys.path]))
    file = tmp_path / "commands.json"
    file.write_text(json.dumps(made), encoding="utf-8")
    piped = in_a_pipe(file, COLUMNS="40")
    print(piped)
    assert re.findall(r"### ends with (.*)", piped) == ["0"] * len(made)
    assert "…" not in piped and "\x1b" not in piped
    narrow = on_a_terminal(file, 40)
    assert "\x1b" in narrow and "…" not in narrow
    rows = re.sub(r"(?m)^.*\n(?=─)", "", piped)  # without headings: the first has no place where rows are no lines
    assert set(unmeasured(rows).split()) - set(unmeasured(narrow).split()) == set()


def test_a_case_is_found_in_a_pipe_and_colours_can_be_switched_off(tmp_path: Path) -> None:
    """`crosscheck list | grep -c spinning_beam/beam_k_subcritical` is 1."""
    file = tmp_path / "commands.json"
    file.write_text(json.dumps([["crosscheck", "list"]]), encoding="utf-8")
    assert len(re.findall("spinning_beam/beam_k_subcritical  ", in_a_pipe(file, COLUMNS="40"))) == 1
    grey = on_a_terminal(file, 40, NO_COLOR="1")
    assert "spinning_beam/beam_k_subcritical" in PLAIN.sub("", grey).splitlines() and "\x1b[3" not in grey
