"""Faults planted in answers: each changes what it says, keeps to the contract, and is caught in an ordinary session and
before the stored reference, there only where the true run agrees.
"""

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from crosscheck.engines.answers import checked_run
from crosscheck.engines.contract import OUTPUTS, MarkerPath, Trajectory
from crosscheck.engines.linear.parts import DERIVATIVES, FREQUENCIES
from crosscheck.engines.trajectories import signals_of
from crosscheck.judging.outcome import conclude
from crosscheck.judging.results import collect
from crosscheck.library.case import Comparison
from crosscheck.library.channels import is_judged
from crosscheck.library.find import load_case, shipped_folder
from crosscheck.library.reference import KNOWLEDGE, VALUES
from crosscheck.mutation.answers import FAULTS, AnswerFault, run_of
from crosscheck.mutation.campaign import run_campaign
from crosscheck.mutation.score import MutationScore
from crosscheck.mutation.subject import subject
from crosscheck.records.kinds import Record, RunRecord
from crosscheck.running.execute import execute
from crosscheck.running.plan import plan
from flexmb.scene.bodies import Node, RigidBody
from flexmb.scene.connectors import AngularSpring, SpringDamper
from flexmb.scene.hinges import AngularCoordinate, Revolute
from flexmb.scene.schema import Marker, Scene, TotalLoad, Wheel
from flexmb.typing import Real
from tests.crosscheck.sessions import PROVIDER, copy_case, referenced, run_here

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
    total_loads=(TotalLoad(name="held", joints=("pivot",), body="arm"),),
)  # fmt: skip


def answer() -> Trajectory:
    """Everything that an engine can offer, at random."""
    rng = np.random.default_rng(1)
    quaternion = rng.normal(size=(5, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    return Trajectory(
        status="finished", message="", times=TIMES,
        markers={"tip": MarkerPath(rng.normal(size=(5, 3)), quaternion, rng.normal(size=(5, 6)))},
        loads={"pivot": rng.normal(size=(5, 6))}, total_loads={"held": rng.normal(size=(5, 6))},
        wheel_loads={"wheel": rng.normal(size=(5, 6))},
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
        against = [verdict.status for verdict in verdicts if (verdict.engine_a, verdict.engine_b) == ("fine", name)]
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
    if any("not installed" in record.message for record in records if isinstance(record, RunRecord)):
        pytest.skip("Pinocchio is not installed")
    verdicts = [each for each in conclude(collect(records)).all if each.engine_a == "native"]
    assert {
        verdict.channel: verdict.status for verdict in verdicts if verdict.engine_b == "pinocchio"
    } == dict.fromkeys(
        ("derivatives.by_displacement", "derivatives.by_speed", "derivatives.by_force", "frequencies"), "agree"
    )
    for name, channels in LINEAR.items():
        found = {verdict.channel for verdict in verdicts if verdict.engine_b == name and verdict.status == "differ"}
        assert found == channels, name
    reasons = [
        verdict.reason for verdict in verdicts if verdict.status == "differ" and verdict.channel != "frequencies"
    ]
    assert all("farthest apart" in reason and "d udot[" in reason for reason in reasons)


CASE = """
[[variant]]
name = "rigid"
engines = ["fine", "stepper"]
also = ["biased"]

[[comparison]]
name = "both"
variant = "rigid"
goals = { marker = 1e-6, "load" = 1e-6 }

[reference]
variant = "rigid"
samples = 11
channels = ["marker", "energy"]
goals = { marker = 1e-6, energy = 1e-6 }
engines = ["fine", "stepper", "biased"]

[[reference.route]]
engine = "fine"

[[reference.route]]
engine = "stepper"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return referenced(tmp_path_factory.mktemp("referenced"), CASE)


def campaign(folder: Path, out: Path, engine: str) -> MutationScore:
    out.mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("crosscheck.mutation.campaign.run_planned", run_here)
        (score,) = run_campaign([load_case(folder)], out, engine=engine, provider=PROVIDER)
    return score


@pytest.fixture(scope="module")
def seeing(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> MutationScore:
    return campaign(folder, tmp_path_factory.mktemp("campaign") / "out", "fine")


def test_what_the_reference_asks_for_is_judged_beside_what_comparisons_do(folder: Path) -> None:
    assert set(subject(load_case(folder), "fine").goals) == {"marker", "load", "energy"}


def test_the_reference_catches_faults_of_the_scene_and_of_an_answer(seeing: MutationScore) -> None:
    noticed = {mutant.mutation for mutant in seeing.mutants if mutant.by_reference == "noticed"}
    assert {"com_sign", "gravity_sign", "gravity_dropped", "node_position"} <= noticed
    assert {"orientation_transposed", "velocity_axes", "late", "energy_gravity"} <= noticed
    assert seeing.score_by_reference is not None and seeing.score_by_reference >= 0.95
    assert all(set(mutant.reference) <= {*mutant.channels} for mutant in seeing.mutants)


def test_of_what_the_reference_does_not_hold_it_says_nothing(seeing: MutationScore) -> None:
    (reaction,) = [mutant for mutant in seeing.mutants if mutant.mutation == "load_reaction"]
    assert (reaction.outcome, reaction.by_reference) == ("noticed", None)


def test_an_engine_that_is_not_at_the_reference_itself_is_not_credited_with_differing(
    folder: Path, tmp_path: Path
) -> None:
    score = campaign(folder, tmp_path / "out", "biased")
    judged = {name for mutant in score.mutants for name in mutant.reference}
    assert "marker:tip.position" not in judged


@pytest.mark.parametrize(("file", "reason"), [(VALUES, "cannot be used"), ("", "no stored reference")])
def test_without_a_reference_that_can_be_used_the_reason_is_told(
    file: str, reason: str, folder: Path, tmp_path: Path
) -> None:
    (tmp_path / "case").mkdir()
    other = copy_case(tmp_path / "case", CASE)
    for name in (VALUES, KNOWLEDGE) if file else ():
        (other / name).write_bytes((folder / name).read_bytes())
    if file:
        (other / file).write_text("spoilt", encoding="utf-8")
    score = campaign(other, tmp_path / "out", "fine")
    assert score.score_by_reference is None and reason in score.no_reference
    assert score.score is not None
