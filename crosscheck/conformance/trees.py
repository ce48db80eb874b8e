"""Trees of several bodies: children of children, branches, and what passes through a chain.

Adapters often get one body right and several wrong: all bodies have the frame of the last one, an offset at the parent
is dropped, a joint's load is handed on with the wrong sign or about the wrong point.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from crosscheck.conformance.clause import Chapter, acceleration, equal, finest_two, given, hold_at_samples, snapshot
from crosscheck.conformance.tree_answers import Answer, initial, moving
from crosscheck.conformance.tree_scenes import (
    AXES,
    bending,
    body,
    branched,
    chain,
    driven,
    loaded,
    out_of_order,
    placed,
    sprung,
    working,
)
from crosscheck.engines.contract import Engine, Snapshot, Trajectory
from flexmb.scene.functions import Constant
from flexmb.scene.schema import Scene
from flexmb.typing import Real

TREES = Chapter(physical=True)
TIMES = np.linspace(0.0, 0.5, 11)
WHEEL: dict[str, Any] = {
    "axis": (0.6, 0.0, 0.8), "mass": 0.8, "axial_inertia": 0.05, "transverse_inertia": 0.03, "speed": 60.0,
    "offset": (0.1, -0.2, 0.3),
}  # fmt: skip


@TREES.clause(
    "A child of a child is placed on its parent, wherever that one is: offsets and turns at both sides add up."
)
def inner_hinges_carry_their_frames(engine: Engine) -> None:
    _places(*_both(engine, chain().scene()))


@TREES.clause("Velocities add up along a chain: those of an inner hinge are relative to its parent, which turns.")
def inner_hinges_add_their_velocities(engine: Engine) -> None:
    _velocities(*_both(engine, chain().scene()))


@TREES.clause("Accelerations of a chain are those of all its bodies together.")
def inner_hinges_accelerate(engine: Engine) -> None:
    _accelerations(*_both(engine, chain().scene()))


@TREES.clause("Branches hang on their own parents: two children of one body, one of which has a child itself.")
def branches_hang_on_their_parents(engine: Engine) -> None:
    answer, right = _both(engine, branched().scene())
    _places(answer, right)
    _velocities(answer, right)
    _accelerations(answer, right)


@TREES.clause("A scene's bodies, hinges and markers may be declared in any order: hinges say what hangs on what.")
def order_of_declaration_does_not_matter(engine: Engine) -> None:
    answer, right = _both(engine, out_of_order())
    _places(answer, right)
    _velocities(answer, right)
    _accelerations(answer, right)


@TREES.clause("The load across an inner hinge is what all outboard of it needs, on its child, about its own point.")
def loads_pass_through_a_chain(engine: Engine) -> None:
    _loads(*_both(engine, branched().scene()))


@TREES.clause("Loads at nodes of inner bodies act on these bodies, and pass on through the hinges.")
def loads_at_nodes_act_in_a_chain(engine: Engine) -> None:
    answer, right = _both(engine, loaded(chain()).scene())
    _accelerations(answer, right)
    _loads(answer, right)


@TREES.clause("Springs, dampers and motors of inner hinges act on both bodies, and are part of the hinge's load.")
def inner_motors_react_on_their_parent(engine: Engine) -> None:
    answer, right = _both(engine, sprung().scene())
    _accelerations(answer, right)
    equal("the spring energy", given("the spring energy", answer.energy.get("spring")), right.energy["spring"])
    _loads(answer, right)


@TREES.clause("An inner slide carries what is outboard of it; it moves along its axis, which turns with its parent.")
def an_inner_slide_moves_along_its_axis(engine: Engine) -> None:
    answer, right = _both(engine, _sliding())
    _places(answer, right)
    _velocities(answer, right)
    _accelerations(answer, right)


@TREES.clause("An inner weld holds its child fast, with all of its inertia.")
def an_inner_weld_holds_fast(engine: Engine) -> None:
    tree = chain(last=False).weld("to end", "middle", "end", **placed("end", "middle"))
    answer, right = _both(engine, tree.scene())
    _places(answer, right)
    _accelerations(answer, right)
    _loads(answer, right)


@TREES.clause("The speeds of an inner ball joint are relative to its parent, in the axes of its own child.")
def an_inner_ball_turns_in_outboard_axes(engine: Engine) -> None:
    ball: dict[str, Any] = {"quaternion": (0.5, -0.5, 0.5, 0.5), "angular_velocity": (1.2, -0.7, 0.5)}
    tree = chain(last=False).spherical("to end", "middle", "end", **ball, **placed("end", "middle"))
    answer, right = _both(engine, tree.scene())
    _places(answer, right)
    _velocities(answer, right)
    _accelerations(answer, right)


@TREES.clause("The position and the speeds of an inner free hinge are relative to its parent, which moves.")
def an_inner_free_hinge_is_relative_to_its_parent(engine: Engine) -> None:
    free: dict[str, Any] = {
        "position": (0.3, -0.2, 0.5), "quaternion": (0.5, -0.5, 0.5, 0.5),
        "angular_velocity": (1.2, -0.7, 0.5), "velocity": (0.6, 0.4, -0.9),
    }  # fmt: skip
    tree = chain(last=False).free("to end", "middle", "end", **free, **placed("end", "middle"))
    answer, right = _both(engine, tree.scene())
    _places(answer, right)
    _velocities(answer, right)
    _accelerations(answer, right)


@TREES.clause("A prescribed inner hinge reports the drive load that all outboard of it needs.")
def an_inner_drive_moves_all_outboard(engine: Engine) -> None:
    answer, right = _both(engine, driven(chain()))
    _velocities(answer, right)
    equal(
        "the drive load of to middle", given("drive loads", answer.drives.get("to middle")), right.drives["to middle"]
    )
    _accelerations(answer, right)
    _loads(answer, right)


@TREES.clause("A wheel on an inner body turns with it: its spin makes the body's motion gyroscopic, and has energy.")
def a_wheel_rides_on_an_inner_body(engine: Engine) -> None:
    tree = chain().wheel("wheel", "middle", node="port", **WHEEL, torque=Constant(value=0.4), friction=0.002).scene()
    answer, right = _both(engine, tree)
    for kind in ("kinetic", "gravity"):
        if kind in answer.energy:
            equal(f"the {kind} energy", answer.energy[kind], right.energy[kind])
    if answer.momentum is not None:
        equal("the momentum", answer.momentum, right.momentum)
    _accelerations(answer, right)
    load = given("the load of a wheel", answer.wheel_loads.get("wheel"))
    _equal("the load of the wheel", load, right.loads["wheel"])
    _loads(answer, right)


@TREES.clause("A fixed point mass at a node of an inner body is carried along, and is part of what its hinge holds.")
def a_point_mass_rides_on_an_inner_body(engine: Engine) -> None:
    answer, right = _both(
        engine, chain().point_mass("lump", "middle", mass=0.6, node="port", offset=(0.2, 0.1, 0)).scene()
    )
    _accelerations(answer, right)
    _loads(answer, right)


@TREES.clause("Momentum, kinetic and gravity energy are sums over all bodies of a tree.")
def momentum_and_energy_are_sums_over_bodies(engine: Engine) -> None:
    answer, right = _both(engine, branched().scene())
    there = [kind for kind in ("kinetic", "gravity") if kind in answer.energy]
    for kind in there:
        equal(f"the {kind} energy", answer.energy[kind], right.energy[kind])
    if not there or answer.momentum is not None:
        _equal("the momentum", given("the momentum, or kinetic and gravity energy", answer.momentum), right.momentum)


@TREES.clause("A tree swings as its equations of motion say, at every sample of a run.")
def a_tree_swings(engine: Engine) -> None:
    rough, fine = finest_two(engine, branched().scene(), TIMES)
    for name in fine.markers:
        paths = [run.markers[name] for run in (rough, fine)]
        where = f"of marker {name}"
        place = np.array([sample.markers[name].position for sample in _swing()])
        hold_at_samples(f"the position (m) {where}", (path.position for path in paths), place, TIMES)
        turned = np.array([sample.markers[name].quaternion for sample in _swing()])
        sided = [path.quaternion * np.sign(np.sum(path.quaternion * turned, axis=1))[:, None] for path in paths]
        hold_at_samples(f"the quaternion {where}", sided, turned, TIMES)
        velocity = np.array([sample.markers[name].velocity for sample in _swing()])
        hold_at_samples(f"the velocity (m/s) {where}", (path.velocity[:, 3:] for path in paths), velocity[:, 3:], TIMES)
        spins = (path.velocity[:, :3] for path in paths)
        hold_at_samples(f"the angular velocity (rad/s) {where}", spins, velocity[:, :3], TIMES)


@TREES.clause("Loads, energies and momentum of a tree are those of its motion at every sample of a run.")
def outputs_of_a_tree_hold_at_every_sample(engine: Engine) -> None:
    runs = finest_two(engine, branched().scene(), TIMES)
    fine = runs[1]
    energies = [kind for kind in ("kinetic", "gravity") if kind in fine.energy]
    given(
        "loads, the momentum, or kinetic and gravity energy",
        fine.loads or energies or fine.momentum is not None or None,
    )
    for kind in energies:
        energy = np.array([[sample.energy[kind]] for sample in _swing()])
        hold_at_samples(f"the {kind} energy (J)", (run.energy[kind][:, None] for run in runs), energy, TIMES)
    for name in fine.loads:
        load = np.array([sample.loads[name] for sample in _swing()])
        hold_at_samples(f"the load (Nm, N) across {name}", (run.loads[name] for run in runs), load, TIMES)
    if fine.momentum is not None:
        momentum = np.array([sample.momentum for sample in _swing()])
        momenta = (np.asarray(given("the momentum", run.momentum)) for run in runs)
        hold_at_samples("the momentum (Nms, Ns)", momenta, momentum, TIMES)


@TREES.clause("Springs, dampers and motors move a tree as they are at each time.")
def springs_and_motors_move_a_tree(engine: Engine) -> None:
    _moves(finest_two(engine, sprung().scene(), TIMES), _sprung())


@TREES.clause("Loads and prescribed hinges move a tree as they are at each time.")
def what_changes_with_time_moves_a_tree(engine: Engine) -> None:
    _moves(finest_two(engine, working(), TIMES), _working())


@TREES.clause("`work` is that of all drives, motors, dampers and loads at nodes of a tree, and of nothing else.")
def work_is_what_the_energy_of_a_tree_gains(engine: Engine) -> None:
    runs = finest_two(engine, working(), TIMES)
    works = [np.asarray(given("the work", run.work)) for run in runs]
    energy = np.array([[sum(sample.energy.values())] for sample in _working()])
    hold_at_samples("the work (J)", ((work - work[0])[:, None] for work in works), energy - energy[0], TIMES)


@TREES.clause("What hangs on a flexible body rides on its deformed node, shifted and turned by all modes.")
def a_child_rides_on_the_deformed_node(engine: Engine) -> None:
    answer, right = _both(engine, bending().scene())
    _places(answer, right)
    _velocities(answer, right)


@TREES.clause("A flexible inner body accelerates with its modes under the load of its child; strain has energy.")
def a_flexible_inner_body_is_loaded_by_its_child(engine: Engine) -> None:
    answer, right = _both(engine, bending().scene())
    for kind in ("kinetic", "strain", "gravity"):
        if kind in answer.energy:
            equal(f"the {kind} energy", answer.energy[kind], right.energy[kind])
    if answer.momentum is not None:
        _equal("the momentum", answer.momentum, right.momentum)
    _accelerations(answer, right)
    _loads(answer, right)


@TREES.clause("A tree with a flexible inner body moves as its equations of motion say, at every sample of a run.")
def a_tree_with_a_flexible_body_swings(engine: Engine) -> None:
    _moves(finest_two(engine, bending().scene(), TIMES), _vibrating())


def _both(engine: Engine, scene: Scene) -> tuple[Snapshot, Answer]:
    return snapshot(engine, scene), initial(scene)


def _places(answer: Snapshot, right: Answer) -> None:
    for name, marker in answer.markers.items():
        _equal(f"the position of marker {name}", marker.position, right.markers[name].position)
        turned = right.markers[name].quaternion
        side = 1.0 if float(np.dot(marker.quaternion, turned)) >= 0.0 else -1.0
        equal(f"the quaternion of marker {name}", side * np.asarray(marker.quaternion), turned)


def _velocities(answer: Snapshot, right: Answer) -> None:
    for name, marker in answer.markers.items():
        _equal(f"the velocity [angular; linear] of marker {name}", marker.velocity, right.markers[name].velocity)


def _accelerations(answer: Snapshot, right: Answer) -> None:
    for name in answer.markers:
        what = f"the acceleration [angular; linear] of marker {name}"
        _equal(what, acceleration(answer, name), right.markers[name].acceleration)


def _loads(answer: Snapshot, right: Answer) -> None:
    given("loads of hinges", answer.loads or None)
    for name in right.loads.keys() & answer.loads.keys():
        _equal(f"the load [torque; force] across {name}", answer.loads[name], right.loads[name])


def _moves(runs: tuple[Trajectory, Trajectory], right: list[Answer]) -> None:
    """The positions of all markers at every sample of the last two runs."""
    for name in runs[-1].markers:
        place = np.array([sample.markers[name].position for sample in right])
        paths = (run.markers[name].position for run in runs)
        hold_at_samples(f"the position (m) of marker {name}", paths, place, TIMES)


def _equal(what: str, answer: Any, expected: Real) -> None:
    """Within POINTWISE of the largest component: in a tree all of them come from one solve."""
    equal(what, answer, expected, max(1.0, float(np.abs(expected).max())))


def _sliding() -> Scene:
    tree = body(chain(last=False), "twig")
    slide: dict[str, Any] = {"axis": AXES[2], "position": 0.3, "rate": -1.4}
    tree.prismatic("to end", "middle", "end", **slide, **placed("end", "middle"))
    return tree.revolute("to twig", "end", "twig", axis=AXES[0], angle=0.6, rate=0.8, **placed("twig", "end")).scene()


@cache
def _swing() -> list[Answer]:
    return moving(branched().scene(), TIMES)


@cache
def _sprung() -> list[Answer]:
    return moving(sprung().scene(), TIMES)


@cache
def _working() -> list[Answer]:
    return moving(working(), TIMES)


@cache
def _vibrating() -> list[Answer]:
    return moving(bending().scene(), TIMES)
