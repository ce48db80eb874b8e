"""Faults planted in answers: each changes what it says, keeps to the contract, and is caught in an ordinary session."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from crosscheck.engines.answers import checked_run
from crosscheck.engines.contract import OUTPUTS, MarkerPath, Trajectory
from crosscheck.engines.linear.parts import DERIVATIVES, FREQUENCIES
from crosscheck.engines.signals import signals_of
from crosscheck.judging.outcome import conclude
from crosscheck.judging.results import collect
from crosscheck.library.case import Comparison
from crosscheck.library.channels import is_judged
from crosscheck.library.find import load_case, shipped_folder
from crosscheck.mutation.answers import FAULTS, AnswerFault, run_of
from crosscheck.records.kinds import Record, RunRecord
from crosscheck.running.execute import execute
from crosscheck.running.plan import plan
from flexmb.scene.bodies import Node, RigidBody
from flexmb.scene.connectors import AngularSpring, SpringDamper
from flexmb.scene.hinges import AngularCoordinate, Revolute
from flexmb.scene.schema import Marker, Scene, Wheel
from flexmb.typing import Real
from tests.crosscheck.sessions import copy_case

TIMES = np.linspace(0.0, 1.0, 5)
ARM = RigidBody(
    name="arm", mass_kg=1.0, inertia_kg_m2=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    nodes=(Node(name="tip"),),
)  # fmt: skip
SCENE = Scene(
    name="arm with a wheel",
    bodies=(ARM,),
    hinges=(Revolute(name="pivot", parent="ground", child="arm", rotation=AngularCoordinate()),),
    wheels=(
        Wheel(
            name="wheel", body="arm", axis=(0.0, 0.6, 0.8), mass_kg=1.0, axial_inertia_kg_m2=0.1,
            transverse_inertia_kg_m2=0.06, speed_rad_s=3.0,
        ),
    ),
    connectors=(
        SpringDamper(name="cable", body_a="ground", position_a_m=(0.0, 1.0, 0.0), body_b="arm", stiffness_N_m=1.0),
        AngularSpring(name="coil", hinge="pivot", stiffness_Nm_rad=1.0),
    ),
    markers=(Marker(name="tip", body="arm", node="tip"),),
)  # fmt: skip


def answer() -> Trajectory:
    """Everything that an engine can offer, at random."""
    rng = np.random.default_rng(1)
    quaternion = rng.normal(size=(5, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    return Trajectory(
        status="finished", message="", times=TIMES,
        markers={"tip": MarkerPath(rng.normal(size=(5, 3)), quaternion, rng.normal(size=(5, 6)))},
        loads={"pivot": rng.normal(size=(5, 6))}, wheel_loads={"wheel": rng.normal(size=(5, 6))},
        drives={"pivot": rng.normal(size=(5, 1))}, connectors={"cable": rng.normal(size=(5, 6))},
        hinge_forces={"coil": rng.normal(size=(5, 1))},
        energy={kind: rng.normal(size=5) for kind in ("kinetic", "strain", "spring", "gravity")},
        momentum=rng.normal(size=(5, 6)), work=rng.normal(size=5),
        derivatives={name: rng.normal(size=(5, 4)) for name in DERIVATIVES},
        frequencies=np.sort(rng.uniform(size=(5, 2)), axis=1),
        known_to=dict.fromkeys((*DERIVATIVES, FREQUENCIES), np.full(5, 1e-12)),
    )  # fmt: skip


def channels(run: Trajectory) -> dict[str, Real]:
    """Those that are compared."""
    return {name: values for name, values in signals_of(run).items() if is_judged(name)}


@pytest.mark.parametrize("fault", FAULTS, ids=lambda each: each.name)
def test_a_fault_changes_some_channels_and_keeps_to_the_contract(fault: AnswerFault) -> None:
    right = channels(answer())
    wrong = channels(checked_run(fault.falsify(answer(), SCENE), TIMES, SCENE))
    changed = {name for name, values in wrong.items() if not np.allclose(values, right[name])}
    assert set(wrong) == set(right)
    assert 0 < len(changed) < len(right) or fault.name == "late"


def test_a_run_is_told_by_its_channels() -> None:
    assert all(getattr(answer(), output) is not None and len(getattr(answer(), output)) for output in OUTPUTS)
    right = channels(answer())
    again = channels(run_of(TIMES, right))
    assert set(again) == set(right)
    assert all(np.array_equal(values, again[name]) for name, values in right.items())


CAUGHT = (
    "load_reaction", "load_reference", "load_axes", "orientation_transposed", "orientation_order", "velocity_axes",
    "rate_unit", "position_unit", "energy_kinetic", "energy_gravity", "late",
)  # fmt: skip


def test_faulty_adapters_are_caught_in_an_ordinary_session(tmp_path: Path) -> None:
    names = ", ".join(f'"{name}"' for name in ("fine", *CAUGHT))
    run_file = f"""
[[variant]]
name = "rigid"
engines = [{names}]

[[comparison]]
name = "all"
variant = "rigid"
goals = {{ "marker:tip" = 1e-6, "load" = 1e-6, "energy" = 1e-6, "momentum" = 1e-6 }}
"""
    record, jobs = plan(load_case(copy_case(tmp_path, run_file)), (), "tests.crosscheck.mutation.faulty_engine:engines")
    records: list[Record] = [record]
    for job in jobs:
        execute(job, lambda content: records.append(content) if isinstance(content, RunRecord) else None)
    verdicts = conclude(collect(records)).all
    for name in CAUGHT:
        against = [each.status for each in verdicts if (each.engine_a, each.engine_b) == ("fine", name)]
        assert "differ" in against, name


LINEAR = {
    "derivative_transposed": {"derivatives.by_displacement", "derivatives.by_speed"},
    "derivative_order": {"derivatives.by_displacement", "derivatives.by_speed", "derivatives.by_force"},
    "derivative_of_position": {"derivatives.by_displacement"},
    "derivative_of_speed": {"derivatives.by_speed"},
    "frequency_unit": {"frequencies"},
}
"""The channels in which each fault differs; the inverse of a mass matrix is its own transpose."""


def test_wrong_derivatives_are_caught_in_an_ordinary_session() -> None:
    case = load_case(shipped_folder() / "manipulators" / "six_axis_arm")
    variant = msgspec.structs.replace(case.run.variant("linearised"), engines=("native", "pinocchio", *LINEAR))
    goals = {"derivatives": 1e-6, "frequencies": 1e-4}
    comparison = Comparison(name="all", variant="linearised", goals=goals)
    run = msgspec.structs.replace(case.run.alone(variant), comparisons=(comparison,))
    provider = "tests.crosscheck.mutation.faulty_engine:peers"
    record, jobs = plan(replace(case, run=run), (), provider)
    records: list[Record] = [record]
    for job in jobs:
        execute(job, lambda content: records.append(content) if isinstance(content, RunRecord) else None)
    if any("not installed" in each.message for each in records if isinstance(each, RunRecord)):
        pytest.skip("Pinocchio is not installed")
    verdicts = [each for each in conclude(collect(records)).all if each.engine_a == "native"]
    assert {each.channel: each.status for each in verdicts if each.engine_b == "pinocchio"} == dict.fromkeys(
        ("derivatives.by_displacement", "derivatives.by_speed", "derivatives.by_force", "frequencies"), "agree"
    )
    for name, channels in LINEAR.items():
        found = {each.channel for each in verdicts if each.engine_b == name and each.status == "differ"}
        assert found == channels, name
    reasons = [each.reason for each in verdicts if each.status == "differ" and each.channel != "frequencies"]
    assert all("farthest apart" in reason and "d udot[" in reason for reason in reasons)
