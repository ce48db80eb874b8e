"""Large trees cost as much a body as small ones: calls of Python functions and bytes are counted, no time is taken."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import fields

import numpy as np
import pytest

from flexmb.building.assemble import assemble
from flexmb.building.links import BodyLink, links
from flexmb.building.numbering import Numbering
from flexmb.scene.build import SceneBuilder
from flexmb.scene.check import SceneError, check_scene
from flexmb.scene.files import load_scene, save_scene
from flexmb.scene.schema import Scene
from flexmb.system.compile import assembled
from flexmb.system.given_values import names_of_states
from flexmb.tables.workspaces import workspace
from tests import trees
from tests.bounds import gamma

PARENTS = {
    "chain": lambda k: k - 1,
    "star": lambda k: min(k, 1) - 1,
    "binary tree": lambda k: (k - 1) // 2 if k else -1,
}
FEW = 48  # a multiple of what some tables are rounded up to


def tree(shape: str, bodies: int) -> SceneBuilder:
    """Rigid bodies on revolute hinges with a node, a marker, a motor and a load each; a wheel on every second one."""
    scene = SceneBuilder(shape, gravity=(0, 0, -9.81))
    for k in range(bodies):
        parent = PARENTS[shape](k)
        scene.rigid_body(f"b{k}", mass=1.0, com=(0.5, 0, 0), inertia=(0.01, 0.1, 0.1), nodes={"end": (1.0, 0.0, 0.0)})
        place = {} if parent < 0 else {"parent_node": "end"}
        motor = {"torque": trees.s.Sine(amplitude=1.0 + k, angular_frequency_rad_s=2.0)}
        scene.revolute(f"h{k}", "ground" if parent < 0 else f"b{parent}", f"b{k}", axis=(0, 1, 0), **motor, **place)
        scene.marker(f"m{k}", f"b{k}", node="end")
        scene.force(f"f{k}", f"b{k}", direction=(1, 0, 0), function=trees.s.Constant(value=float(k)))
        if k % 2:
            scene.wheel(f"w{k}", f"b{k}", axis=(0, 0, 1), mass=0.1, axial_inertia=0.1, transverse_inertia=0.1)
    return scene


def calls(function: Callable[[], object]) -> int:
    """How many functions it calls, those in C too."""
    count = 0

    def note(_frame, event, _argument):
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(note)
    try:
        function()
    finally:
        sys.setprofile(None)
    return count


def is_linear(make: Callable[[int], Callable[[], object]]) -> bool:
    """Whether twice the bodies take at most 2.1 times the calls."""
    make(FEW)()  # what is found once and kept
    return calls(make(2 * FEW)) <= 2.1 * calls(make(FEW))


STEPS: dict[str, Callable[[Scene], Callable[[], object]]] = {
    "check": lambda scene: lambda: check_scene(scene),
    "assembly": lambda scene: lambda: assembled(scene),
    "names": lambda scene: (lambda system: lambda: names_of_states(system))(assembled(scene)),
    "initial state": lambda scene: (lambda system: lambda: system.initial_state)(assembled(scene)),
}


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("shape", PARENTS)
def test_calls_grow_with_the_number_of_bodies(shape, step):
    assert is_linear(lambda bodies: STEPS[step](tree(shape, bodies).scene()))


@pytest.mark.parametrize("shape", PARENTS)
def test_building_and_reading_do_so_too(shape, tmp_path):
    assert is_linear(lambda bodies: lambda: tree(shape, bodies).scene())

    def reading(bodies: int) -> Callable[[], object]:
        path = tmp_path / f"{bodies}.toml"
        save_scene(tree(shape, bodies).scene(), path)
        return lambda: load_scene(path)

    assert is_linear(reading)


def test_calls_that_grow_faster_are_noticed():
    def pairs(bodies: int) -> Callable[[], object]:
        return lambda: [abs(i - j) for i in range(bodies) for j in range(bodies) if abs(i - j) == 1]

    assert not is_linear(pairs)


@pytest.mark.parametrize("shape", PARENTS)
def test_bytes_a_body_are_constant(shape):
    assert _bytes(shape, 2 * FEW) == 2 * _bytes(shape, FEW)


def _bytes(shape: str, bodies: int) -> int:
    """Of constants and workspace, without what all scenes have once."""
    system = assembled(tree(shape, bodies).scene())
    made = system.constants, workspace(system.constants, system.nq, system.nu)
    return sum(
        np.asarray(array).nbytes
        for tables in made
        for field in fields(tables)
        if len(array := getattr(tables, field.name)) >= FEW // 2
    )


@pytest.mark.parametrize("shape", PARENTS)
def test_no_depth_is_too_deep(shape):
    """Four times Python's limit of recursion."""
    bodies = 4 * sys.getrecursionlimit()
    scene = SceneBuilder(shape)
    for k in range(bodies):
        parent = PARENTS[shape](k)
        scene.rigid_body(f"b{k}", mass=1.0, inertia=(0.1, 0.1, 0.1))
        scene.revolute(f"h{k}", "ground" if parent < 0 else f"b{parent}", f"b{k}")
    system = assembled(scene.scene())
    assert (system.nq, len(system.constants.body)) == (bodies, bodies)


def test_a_body_at_fault_is_found_among_many():
    """Each fault in its place, whatever is right around it."""
    scene = tree("chain", 50)
    scene.rigid_body("odd", mass=-1.0, inertia=(0.1, 0.1, 0.5))
    scene.revolute("loose", "b7", "odd", axis=(0, 0, 2.0), damping=-1.0, rest=float("nan"))
    scene.universal("none", "b3", "b9", parent_node="nowhere")
    with pytest.raises(SceneError) as refused:
        scene.scene()
    found = sorted(problem.where.split(" ")[0] for problem in refused.value.problems)
    assert found == [
        "$.bodies[50].inertia_kg_m2", "$.bodies[50].mass_kg", "$.hinges[50].axis", "$.hinges[50].rotation.rest_rad",
        "$.hinges[51]", "$.hinges[51].parent_node",
    ]  # fmt: skip


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("recipe", [trees.RIGID, trees.MIXED])
def test_rigid_bodies_at_once_are_those_of_their_links(recipe, seed):
    """Frames and inertia in one step of arrays against each link's ports and model by themselves."""
    scene = trees.random_scene(seed, recipe)
    chain = links(scene)
    constants = assemble(scene, chain, Numbering(chain, scene)).constants
    for k, link in enumerate(chain):
        body = constants.body[k]
        rigid = link.level.tables(link.model, link.wheels).rigid
        if link.level.name == "rigid":
            np.testing.assert_allclose(body["rigid"], rigid, rtol=0, atol=gamma(72) * np.max(np.abs(rigid)))
        position, rotation = _inboard(link, chain)
        np.testing.assert_allclose(body["placement_position"], position, rtol=0, atol=gamma(72) * 10.0)
        np.testing.assert_allclose(body["placement_rotation"].reshape(3, 3), rotation, rtol=0, atol=gamma(72))


def _inboard(link: BodyLink, chain: list[BodyLink]) -> tuple[np.ndarray, np.ndarray]:
    """Position and rotation of the inboard hinge frame in the frame of the parent's link."""
    at = link.inboard
    parent = next((each for each in chain if each.name == link.parent), None)
    if parent is None or parent.outboard.deforms:
        return at.origin, at.frame
    back = parent.outboard.frame.T
    return back @ (at.origin - parent.outboard.origin), back @ at.frame
