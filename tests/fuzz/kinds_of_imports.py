"""What other programs wrote: robots, SID files, finite-element matrices and their nodes."""

import math
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import msgspec
import numpy as np

from flexmb.interchange.imported import ModelError
from flexmb.interchange.mjcf import read_mjcf
from flexmb.interchange.sid import SidError, imported_sid, read_sid, sid_of, write_sid
from flexmb.interchange.superelement import SuperElementError, read_super_element
from flexmb.interchange.urdf import read_urdf
from flexmb.scene.problems import SceneError
from flexmb.scene.schema import Scene
from tests.flexmb.interchange import made_matrices
from tests.flexmb.interchange.made_bodies import beam, free_beam
from tests.flexmb.interchange.made_robots import MJCF, arm, quadruped
from tests.flexmb.interchange.test_superelement_files import NODES, K, M, large_field_dmig, written
from tests.fuzz import mutate
from tests.fuzz.kind import Kind

INERTIAL = """<mujoco model="given">
  <compiler angle="degree"/>
  <default><joint damping="0.05"/><default class="heavy"><geom density="2000"/></default></default>
  <include file="more.xml"/>
  <worldbody>
    <body name="hub" pos="0 0 1">
      <inertial pos="0.1 0.2 -0.3" mass="2" diaginertia="0.2 0.3 0.4"/><freejoint name="float"/>
      <body name="inf" pos="0.5 0 0" axisangle="0 0 1 30">
        <inertial pos="-0.1 0 0.2" mass="1" fullinertia="0.2 0.3 0.4 0.01 0.02 0.03"/>
        <joint name="turn" axis="0 1 0" stiffness="2" springref="5" ref="3"/>
        <replicate count="3" offset="0.1 0 0"><geom size="0.02" mass="0.1" contype="0" conaffinity="0"/></replicate>
      </body>
    </body>
  </worldbody>
</mujoco>"""
MORE = b'<mujoco><option gravity="0.1 0 -9.81"/></mujoco>'
NO_NUMBER = re.compile(r"[-+]?(nan(\(.*\))?|inf(inity)?|[\d.]+e\d{4,}|[\d.]+e[4-9]\d\d)", re.IGNORECASE)
NAMES = ("name", "class", "childclass", "model", "file", "type", "link", "filename")


def of_imports(folder: Path) -> dict[str, Kind]:
    """Kinds by name; what lies beside the mutants is put into `folder`."""
    (folder / "more.xml").write_bytes(MORE)
    (folder / "nodes.csv").write_text(NODES)
    mass, _ = written("mtx", folder)[1], (folder / "K.mtx").rename(folder / "given.mtx")
    xml = (*mutate.TEXT, mutate.lines, mutate.elements, *[mutate.attributes] * 5)
    lines = (*mutate.TEXT, mutate.lines, mutate.lines, *[mutate.number] * 3)
    robots, errors = (arm().encode(), quadruped().encode()), (ModelError, SceneError)
    matrices = (SuperElementError,)
    punched = (large_field_dmig("KAAX", K) + large_field_dmig("MAAX", M)).encode()
    packed, _ = written("dense", folder)
    forms = [made_matrices.binary_op4({"K": K, "M": M}, form) for form in ("dense", "sparse", "big")]
    (folder / "m_by_node.mtx").write_text(made_matrices.matrix_input(M))
    for stem in ("b", "d"):
        (folder / f"{stem}.mas").write_text(made_matrices.calculix(M))
        (folder / f"{stem}.dof").write_text(made_matrices.dof(len(K)))
    (folder / "d.sti").write_text(made_matrices.calculix(K))
    written("ansys", folder)
    at = [line.split(",") for line in NODES.splitlines()[1:]]
    inp = "*NODE, NSET=ALL\n" + "".join(f"{', '.join(words)}\n" for words in at) + "*STEP\n"
    grids = "".join(f"GRID,{i},,{x},{y},{z}\n" for i, x, y, z in at)
    return {
        "urdf": Kind("robot.urdf", tuple(map(_in_lines, robots)), xml, errors, _urdf),
        "mjcf": Kind("robot.xml", (MJCF.encode(), INERTIAL.encode()), xml, errors, _mjcf),
        "mjcf include": Kind("more.xml", (MORE,), xml, errors, lambda path: _including(path), "robot.xml"),
        "sid": Kind("body.sid", _sids(folder), lines, (SidError, SceneError), _sid, "body.sid"),
        "punch": Kind("both.pch", (punched,), lines, matrices, lambda path: _structure(path, path)),
        "op4": Kind("both.op4", (packed.read_bytes(),), lines, matrices, lambda path: _structure(path, path)),
        "mtx": Kind(
            "K.mtx", ((folder / "given.mtx").read_bytes(),), lines, matrices, lambda path: _structure(path, mass)
        ),
        "coordinate": Kind(
            "K.mtx", (made_matrices.coordinate(K).encode(),), lines, matrices, lambda path: _structure(path, mass)
        ),
        "matrix input": Kind(
            "by_node.mtx", (made_matrices.matrix_input(K).encode(),), lines, matrices,
            lambda path: _structure(path, path.with_name("m_by_node.mtx")),
        ),
        "calculix": Kind(
            "b.sti", (made_matrices.calculix(K).encode(),), lines, matrices,
            lambda path: _structure(path, path.with_suffix(".mas")),
        ),
        "dof": Kind(
            "d.dof", (made_matrices.dof(len(K)).encode(),), lines, matrices,
            lambda path: _element(
                path.with_suffix(".sti"), path.with_suffix(".mas"), path.with_name("nodes.csv"), path
            ),
        ),
        "mapping": Kind(
            "K.mapping", (made_matrices.mapping(len(K)).encode(),), lines, matrices,
            lambda path: _element(
                path.with_suffix(".matrix"), path.with_name("M.matrix"), path.with_name("nodes.csv"), path
            ),
        ),
        "op4 binary": Kind("packed.op4", tuple(forms), mutate.BYTES, matrices, lambda path: _structure(path, path)),
        "inp": Kind("mesh.inp", (inp.encode(),), lines, matrices, lambda path: _nodes(path, mass)),
        "grid": Kind("mesh.bdf", (grids.encode(),), lines, matrices, lambda path: _nodes(path, mass)),
        "nodes": Kind("nodes.csv", (NODES.encode(),), lines, matrices, lambda path: _nodes(path, mass)),
    }  # fmt: skip


def _in_lines(xml: bytes) -> bytes:
    return xml.replace(b"><", b">\n<")


def _sids(folder: Path) -> tuple[bytes, ...]:
    found = []
    for body in (beam(), free_beam()):
        write_sid(sid_of(body), folder / "seed.sid")
        found.append((folder / "seed.sid").read_bytes())
    (folder / "seed.sid").unlink()
    return tuple(found)


def _urdf(path: Path) -> str | None:
    scene = read_urdf(path).scene
    root = ElementTree.fromstring(path.read_text(encoding="utf-8-sig"))
    given = {
        link.get("name"): (link.find("inertial/mass"), link.find("inertial/origin")) for link in root.findall("link")
    }
    return _not_finite(scene) or _masses(scene, given, "value", "xyz") or _doubled(root)


def _doubled(root: ElementTree.Element) -> str | None:
    """A link, a joint or an inertial with two elements of which only one can be meant."""
    once = {"mass", "inertia", "inertial", "parent", "child", "axis", "mimic", "origin"}
    for element in (*root.findall("link"), *root.findall("joint"), *root.findall("link/inertial")):
        tags = [child.tag for child in element if child.tag in once]
        if len(set(tags)) < len(tags):
            return f"{element.tag} has one of {tags} twice"
    return None


def _mjcf(path: Path) -> str | None:
    scene = read_mjcf(path).scene
    text = re.sub(r"<!--.*?-->", "", path.read_text(encoding="utf-8-sig"), flags=re.DOTALL)
    root = ElementTree.fromstring(text)
    given = {body.get("name"): (body.find("inertial"), body.find("inertial")) for body in root.iter("body")}
    return _texts(root) or _not_finite(scene) or _masses(scene, given, "mass", "pos")


def _including(path: Path) -> str | None:
    robot = path.with_name("robot.xml")
    robot.write_text(INERTIAL)
    return _mjcf(robot) or _texts(
        ElementTree.fromstring(re.sub(r"<!--.*?-->", "", path.read_text(encoding="utf-8-sig"), flags=re.DOTALL))
    )


def _texts(root: ElementTree.Element) -> str | None:
    """A number that is none, in an attribute that is no name."""
    for element in root.iter():
        for key, text in element.attrib.items():
            if key not in NAMES and any(NO_NUMBER.fullmatch(word) for word in text.split()):
                return f'{element.tag} {key}="{text}" was accepted'
    return None


def _masses(scene: Scene, given: dict[Any, Any], mass: str, place: str) -> str | None:
    """Masses and their centres are those of the file, where it gives them."""
    bodies = {body.name: body for body in scene.bodies}
    for name, (of_mass, of_place) in given.items():
        body = bodies.get(name)
        if body is None or of_mass is None:
            continue
        if of_mass.get(mass) and body.mass_kg != _real(of_mass.get(mass)):
            return f"{name} has the mass {body.mass_kg}, not {of_mass.get(mass)}"
        where = None if of_place is None else of_place.get(place)
        if where and body.com_m != tuple(map(_real, where.split())):
            return f"{name} has its mass centre at {body.com_m}, not {where}"
    return None


def _real(text: str) -> float:
    """As C reads numbers, and so MuJoCo: hexadecimal ones too."""
    return float.fromhex(text) if "0x" in text.lower() else float(text)


def _not_finite(value: Any) -> str | None:
    numbers = _numbers(msgspec.to_builtins(value))
    return None if all(map(math.isfinite, numbers)) else "a number is not finite"


def _numbers(value: Any) -> list[float]:
    if isinstance(value, dict):
        return [number for item in value.values() for number in _numbers(item)]
    if isinstance(value, list | tuple):
        return [number for item in value for number in _numbers(item)]
    return [value] if isinstance(value, float) else []


def _sid(path: Path) -> str | None:
    sid = read_sid(path)
    body = imported_sid(sid, "body").body
    given = re.findall(r"(?im)^\s*mass\s*=\s*([-+\w.]+)", path.read_text(encoding="utf-8-sig"))
    if given and float(given[-1].lower().replace("d", "e")) != sid.mass:
        return f"the mass is {sid.mass}, not {given[-1]}"
    return _not_finite(body)


def _structure(K: Path, M: Path) -> str | None:
    return _element(K, M, K.with_name("nodes.csv"), K)


def _nodes(path: Path, mass: Path) -> str | None:
    return _element(path.with_name("given.mtx"), mass, path, path)


def _element(K: Path, M: Path, nodes: Path, mutant: Path) -> str | None:
    try:
        found = read_super_element(K, M, nodes)
    except SuperElementError as error:  # checks of the whole structure are about all files
        raise SuperElementError(f"{mutant.name}: {error}") from None
    arrays = (found.K, found.M, found.position)
    if not all(np.all(np.isfinite(array)) for array in arrays):
        return "a number is not finite"
    return None if np.array_equal(found.K, found.K.T) and np.array_equal(found.M, found.M.T) else "not symmetric"
