"""FMUs that flexmb has not made: a pendulum in C with other names, units and signs, and its scene and mappings."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import zipfile
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import pytest

from flexmb.scene.files import save_scene
from flexmb.scene.hinges import AngularCoordinate, Revolute
from flexmb.scene.schema import Marker, Node, RigidBody, Scene

SOURCE = Path(__file__).parent / "pendulum.c"
COMPILER = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
needs_compiler = [
    pytest.mark.skipif(
        platform.machine() != "x86_64" or os.name != "posix", reason="libraries are for Linux on x86-64"
    ),
    pytest.mark.skipif(COMPILER is None, reason="no C compiler is on the path"),
]
DEG = "0.017453292519943295"
UNITS = {
    "deg": f'rad="1" factor="{DEG}"', "deg/s": f'rad="1" s="-1" factor="{DEG}"', "g": 'kg="1" factor="1e-3"',
    "mm": 'm="1" factor="1e-3"', "g.mm2": 'kg="1" m="2" factor="1e-9"', "m/s2": 'm="1" s="-2"',
    "mN": 'kg="1" m="1" s="-2" factor="1e-3"', "mm/s": 'm="1" s="-1" factor="1e-3"', "rad/s": 'rad="1" s="-1"',
    "N.mm": 'kg="1" m="2" s="-2" factor="1e-3"', "s": 's="1"', "1": "",
}  # fmt: skip
VARIABLES = [ # name, reference, causality, variability, initial, unit, more
    ("phi", 0, "output", "continuous", "exact", "deg", 'start="30"'),
    ("omega", 1, "output", "continuous", "exact", "deg/s", 'start="0"'),
    ("der(phi)", 2, "local", "continuous", "", "deg/s", 'derivative="1"'),
    ("der(omega)", 3, "local", "continuous", "", "", 'derivative="2"'),
    ("mass", 4, "parameter", "tunable", "exact", "g", 'start="100"'),
    ("length", 5, "parameter", "tunable", "exact", "mm", 'start="100"'),
    ("J", 6, "parameter", "fixed", "exact", "g.mm2", 'start="0"'),
    ("g", 7, "parameter", "tunable", "exact", "m/s2", 'start="9.81"'),
    ("torque", 8, "input", "continuous", "", "N.mm", 'start="0"'),
    ("h", 9, "parameter", "fixed", "exact", "s", 'start="0.01"'),
    ("fault", 10, "parameter", "tunable", "exact", "", 'start="0"'),
    ("wall", 11, "parameter", "tunable", "exact", "deg", 'start="-1e9"'),
    ("J0", 12, "calculatedParameter", "fixed", "calculated", "g.mm2", ""),
    ("Fx", 13, "output", "continuous", "", "mN", ""),
    ("Fz", 14, "output", "continuous", "", "mN", ""),
    ("T", 15, "output", "continuous", "", "", ""),
    ("V", 16, "output", "continuous", "", "", ""),
    ("pi", 17, "output", "constant", "exact", "1", 'start="3"'),
]  # fmt: skip
ARRAYS = [("tip", 100, (3,), "mm"), ("speed", 101, (3,), "mm/s"), ("R", 102, (3, 3), "1"), ("spin", 103, (3,), "rad/s")]


def description(version: str, interfaces: str = "both", more: str = "") -> str:
    """The text of modelDescription.xml for FMI "2.0" or "3.0"."""
    second = version == "2.0"
    units = "".join(f'<Unit name="{name}"><BaseUnit {base}/></Unit>' for name, base in UNITS.items())
    lines = []
    for name, reference, causality, variability, initial, unit, rest in VARIABLES:
        first = f' initial="{initial}"' if initial else ""
        given = f'unit="{unit}" {rest}' if unit else rest
        head = f'name="{name}" valueReference="{reference}" causality="{causality}" variability="{variability}"{first}'
        if second:
            lines.append(f"<ScalarVariable {head}><Real {given}/></ScalarVariable>")
        else:
            rest = given.replace('derivative="1"', 'derivative="0"').replace('derivative="2"', 'derivative="1"')
            lines.append(f"<Float64 {head} {rest}/>")
    if second:
        lines.append(
            '<ScalarVariable name="label" valueReference="0" causality="parameter" variability="fixed" initial="exact">'
            '<String start="one"/></ScalarVariable>'
        )
    else:
        for name, reference, shape, unit in ARRAYS:
            sizes = "".join(f'<Dimension start="{size}"/>' for size in shape)
            lines.append(
                f'<Float64 name="{name}" valueReference="{reference}" causality="output" unit="{unit}">{sizes}'
                "</Float64>"
            )
    offered = {
        "both": ("ModelExchange", "CoSimulation"), "exchange": ("ModelExchange",), "simulation": ("CoSimulation",),
        "none": (),
    }[interfaces]  # fmt: skip
    kinds = "".join(f'<{kind} modelIdentifier="pendulum"/>' for kind in offered)
    outputs = [i for i, each in enumerate(VARIABLES, 1) if each[2] == "output"]
    if second:
        structure = "<Outputs>" + "".join(f'<Unknown index="{i}"/>' for i in outputs) + "</Outputs>"
        structure += '<Derivatives><Unknown index="3"/><Unknown index="4"/></Derivatives>'
        return (
            f'<?xml version="1.0"?><fmiModelDescription fmiVersion="2.0" modelName="swing" guid="{{1}}" '
            f'generationTool="by hand" numberOfEventIndicators="1" {more}>{kinds}'
            f"<UnitDefinitions>{units}</UnitDefinitions>"
            f"<ModelVariables>{''.join(lines)}</ModelVariables><ModelStructure>{structure}</ModelStructure>"
            "</fmiModelDescription>"
        )
    structure = "".join(f'<Output valueReference="{VARIABLES[i - 1][1]}"/>' for i in outputs)
    structure += "".join(f'<Output valueReference="{reference}"/>' for _, reference, *_ in ARRAYS)
    structure += '<ContinuousStateDerivative valueReference="2"/><ContinuousStateDerivative valueReference="3"/>'
    structure += '<EventIndicator valueReference="11"/>'
    return (
        f'<?xml version="1.0"?><fmiModelDescription fmiVersion="3.0" modelName="swing" instantiationToken="{{1}}" '
        f'generationTool="by hand" {more}>{kinds}<UnitDefinitions>{units}</UnitDefinitions>'
        f"<ModelVariables>{''.join(lines)}</ModelVariables><ModelStructure>{structure}</ModelStructure>"
        "</fmiModelDescription>"
    )


@cache
def library(version: str) -> Path:
    """The compiled model, once a process."""
    assert COMPILER is not None
    path = Path(mkdtemp()) / "pendulum.so"
    more = [] if version == "2.0" else ["-DFMI3"]
    command = [COMPILER, "-std=gnu11", "-O1", "-shared", "-fPIC", *more, str(SOURCE), "-o", str(path), "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    return path


def write_fmu(path: Path, version: str = "2.0", interfaces: str = "both", folder: str = "", more: str = "") -> Path:
    """The pendulum as an FMU; `folder` of its library instead of that of this platform."""
    own = folder or ("linux64" if version == "2.0" else "x86_64-linux")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", description(version, interfaces, more))
        archive.write(library(version), f"binaries/{own}/pendulum.so")
    return path


def scene(mass: float = 0.25, angle: float = -0.9, rate: float = 1.5) -> Scene:
    """The scene that the FMU models with the parameters of `MAPPING`: a rod on the ground, about y."""
    length = 0.3
    rod = RigidBody(
        name="rod", mass_kg=mass, com_m=(0.0, 0.0, -length),
        inertia_kg_m2=((3e-3, 0.0, 0.0), (0.0, 2e-3, 0.0), (0.0, 0.0, 3e-3)),
        nodes=(Node(name="end", position_m=(0.0, 0.0, -length)),),
    )  # fmt: skip
    pivot = Revolute(
        name="pivot", parent="ground", child="rod", axis=(0.0, 1.0, 0.0),
        rotation=AngularCoordinate(angle_rad=angle, rate_rad_s=rate),
    )  # fmt: skip
    return Scene(
        name="swing", bodies=(rod,), hinges=(pivot,), gravity_m_s2=(0.0, 0.0, -9.81),
        markers=(Marker(name="end", body="rod", node="end"),),
    )  # fmt: skip


MAPPING = """
scene = "scene.toml"
fmu = "swing.fmu"

[channels]
"pivot.rotation" = { variable = "phi", sign = -1 }
"pivot.rotation.rate" = { variable = "omega", sign = -1 }
"pivot.torque.x" = 0.0
"pivot.torque.y" = 0.0
"pivot.torque.z" = 0.0
"pivot.force.x" = { variable = "Fx", sign = -1 }
"pivot.force.y" = 0.0
"pivot.force.z" = { variable = "Fz", sign = -1 }
"energy.kinetic" = { variable = "T", unit = "mJ" }
"energy.gravity" = { variable = "V", unit = "mJ" }
"energy.spring" = 0.0
"energy.strain" = 0.0

[parameters]
mass = { scene = "rod.mass_kg" }
length = { scene = "rod.com_m.2", sign = -1 }
J = { scene = "rod.inertia_kg_m2.1.1" }
g = { scene = "gravity_m_s2.2", sign = -1 }
phi = { scene = "pivot.rotation.angle_rad", sign = -1 }
omega = { scene = "pivot.rotation.rate_rad_s", sign = -1 }
torque = 0.0
"""


def vector(column: str, variable: str) -> str:
    """The lines that map a vector to an array of FMI 3."""
    return "".join(f'"{column}.{axis}" = "{variable}[{i}]"\n' for i, axis in enumerate("xyz", 1))


def with_arrays(mapping: str = MAPPING) -> str:
    """The mapping with the marker by arrays, its rotation as a transposed matrix, in place of coordinates."""
    kept = [line for line in mapping.splitlines() if not line.startswith('"pivot.rotation')]
    lines = vector("end.position", "tip") + vector("end.velocity", "speed") + vector("end.angular_velocity", "spin")
    lines += "".join(f'"end.rotation[{i},{j}]" = "R[{j},{i}]"\n' for i in (1, 2, 3) for j in (1, 2, 3))
    return "\n".join(kept).replace("[channels]\n", "[channels]\n" + lines)


def write_mapping(folder: Path, text: str = MAPPING, version: str = "2.0", **of_fmu: str) -> str:
    """The FMU, its mapping and its scene in a folder; returns the name of the engine."""
    save_scene(scene(), folder / "scene.toml")
    write_fmu(folder / "swing.fmu", version, **of_fmu)
    (folder / "swing.toml").write_text(text, encoding="utf-8")
    return f"fmu:{folder / 'swing.toml'}"
