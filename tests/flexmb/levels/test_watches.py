"""Watches of accuracy: every door that answers a question about a motion tells what points and polynomials leave out.

The doors are the public functions that take a scene, found by their signatures.

A run or an equilibrium says that loads would stretch a beam of level exact whose stretch is held by default."""

from __future__ import annotations

import inspect
import re
import warnings
from typing import get_args

import numpy as np
import pytest
from msgspec.structs import replace

import flexmb as fm
from flexmb.scene import schema as s
from flexmb.scene.bodies import Family
from flexmb.system import held_stretch, watches
from flexmb.system.enough_polynomials import ALLOWED
from flexmb.system.watches import WAIVERS, WATCHES
from tests.flexmb.levels.strain_beams import PLANE, beam
from tests.repo.project import ROOT

NUMBER, WATCHED = "push.function.value", ["energy.total"]


def bent(count=2, points=None, force=7.0):
    """A rod of length 1 on a hinge that a force on its tip, which turns with it, keeps bent far."""
    builder = beam(s.Modes(count=count, points=points, families=PLANE, viscosity_s=0.3))
    builder.revolute("hub", "ground", "rod", axis=(0, 0, 1), prescribed=fm.Constant(value=0.0))
    builder.force("push", "rod", node="tip", direction=(0, 1, 0), frame="node",
                  function=fm.Constant(value=force))  # fmt: skip
    return replace(builder.marker("tip", "rod", node="tip").scene(), allow=("wave_speed", "uncut_beam", "held_stretch"))


RUN = {"rtol": 1e-4}
ANSWERS = {
    "simulate": lambda scene: fm.simulate(scene, 2.0, samples=21, **RUN),
    "simulate_stages": lambda scene: fm.simulate_stages(scene, [fm.RunStage(2.0, samples=21)], **RUN),
    "simulate_batch": lambda scene: fm.simulate_batch([scene, scene], 2.0, samples=21, **RUN),
    "equilibrium": fm.equilibrium,
    "equilibrium_path": lambda scene: fm.equilibrium_path(scene, NUMBER, [0.5, 7.0]),
    "linearize": lambda scene: fm.linearize(scene, quietly(fm.equilibrium, fm.compile(scene))),
    "linearize_sampled": lambda scene: fm.linearize_sampled(scene, 0.01, quietly(fm.equilibrium, fm.compile(scene))),
    "base_excitation": lambda scene: fm.base_excitation(scene, quietly(fm.equilibrium, fm.compile(scene))),
    "steady_spin": lambda scene: fm.steady_spin(scene, "hub", 0.01),
    "campbell": lambda scene: fm.campbell(scene, "hub", [0.0, 0.01]),
    "sensitivities": lambda scene: fm.sensitivities(scene, 2.0, [NUMBER], WATCHED, samples=21, **RUN),
    "uncertainty": lambda scene: fm.uncertainty(scene, 2.0, {NUMBER: 0.1}, WATCHED, samples=21, **RUN),
    "gradient": lambda scene: fm.gradient(scene, 2.0, [NUMBER], fm.FinalValue("energy.total"), **RUN),
    "check_scene": lambda scene: warned_by(fm.check_scene(started_bent(scene))),
}
"""Each door with a scene that bends too far."""
OTHERS = {
    "compile": "answers nothing yet, and shows what the check knows",
    "compile_batch": "the same",
    "save_scene": "writes the scene",
    "open_loop": "returns another scene",
    "fit": "does not speak of trial values",
    "stability_map": "warns as linearize_sampled does, at every pair of values",
    "advise": "measures models against finer ones",
}
QUICK = ("simulate", "simulate_batch", "equilibrium")


def quietly(call, *arguments):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return call(*arguments)


def started_bent(scene):
    """With the strains of its equilibrium at the start."""
    system = fm.compile(scene)
    modes = quietly(fm.equilibrium, system).q[system.coordinate("rod.modes")]
    return replace(scene, modal_states=(s.ModalState(body="rod", coordinates=tuple(modes.tolist())),))


def warned_by(doubts):
    """The doubts as warnings, to compare them with those of other doors."""
    for doubt in doubts:
        warnings.warn(f"{doubt.what}; {doubt.remedy}", fm.SceneWarning, stacklevel=1)


def told(call, scene):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call(scene)
    return [str(each.message) for each in caught if issubclass(each.category, fm.SceneWarning)]


def test_every_door_is_known():
    """Every public function that takes a scene, a system or a batch answers, or says why it does not."""
    found = set()
    for name in fm.__all__:
        call = getattr(fm, name)
        if inspect.isfunction(call):
            kinds = " ".join(str(parameter.annotation) for parameter in inspect.signature(call).parameters.values())
            if re.search(r"\b(Scene|System|Batch)\b", kinds):
                found.add(name)
    assert found == set(ANSWERS) | set(OTHERS)
    assert len(WAIVERS) == len(WATCHES) and set(WAIVERS) <= set(get_args(s.Waiver))


@pytest.mark.parametrize(
    "door", [pytest.param(door, marks=() if door in QUICK else pytest.mark.slow) for door in ANSWERS]
)
def test_every_door_tells_of_few_polynomials_and_points(door):
    """Once each, with the number to set, and by the word that waives it not."""
    for scene, pattern, waiver in (
        (bent(), r"give its modes \d+ polynomials of bending_y", "few_polynomials"),
        (bent(count=4, points=5), r"give its modes points = \d+", "few_points"),
    ):
        words = [word for word in told(ANSWERS[door], scene) if re.search(pattern, word)]
        assert len(words) == 1 and 'beam "rod"' in words[0], words
        waived = replace(scene, allow=(*scene.allow, waiver))
        assert not any(re.search(pattern, word) for word in told(ANSWERS[door], waived))


SWING_S = 10.0
"""Of a force that rises and falls again; the rod follows by a third of a second."""


def swung(force, **given):
    """Straight at both output times, and bent in between."""
    builder, function = bent(**given), fm.Sine(amplitude=force, angular_frequency_rad_s=np.pi / SWING_S)
    (push,) = builder.loads
    return replace(builder, loads=(replace(push, function=function),))


@pytest.mark.parametrize("method", ["dop853", "radau5"])
@pytest.mark.parametrize(("given", "waiver"), [({}, "few_polynomials"), ({"count": 4, "points": 5}, "few_points")])
def test_what_bends_between_output_times_is_noticed(method, given, waiver, monkeypatch):
    """In runs and batches, which name the copies; negative control: by the output times alone nothing is."""
    scenes = [swung(force, **given) for force in (0.3, 7.0, 0.5, 6.5)]
    if waiver == "few_points":
        scenes = [replace(each, allow=(*each.allow, "few_polynomials")) for each in scenes]
    settings = {"method": method, "samples": 2, "rtol": 1e-4, "atol": 1e-6}

    def runs():
        return [told(lambda scene: fm.simulate(scene, SWING_S, **settings), scene) for scene in scenes]

    def batch():
        return told(lambda scenes: fm.simulate_batch(scenes, SWING_S, **settings), scenes)

    single, (word,) = runs(), batch()
    assert [len(words) for words in single] == [0, 1, 0, 1]
    assert "(copies 1, 3; copy 1 is the worst)" in word
    assert 'beam "rod" bends more' in word and word.split(" at t = ")[0] == single[1][0].split(" at t = ")[0]
    monkeypatch.setattr(watches.WatchedStates, "with_steps", lambda seen: (seen.t, seen.q, seen.u))
    assert not any(runs()) and not batch()


def test_the_polynomials_that_are_named_are_enough():
    """At rest under the same force with three more the tip moves by less than a tenth of ALLOWED; from two polynomials
    by more. Nothing is said of small turns, even if two polynomials were exact."""

    def tip(count):
        system = fm.compile(replace(bent(count, force=4.0), allow=("wave_speed", *WAIVERS)))
        state = fm.equilibrium(system)
        return system.evaluate(0.0, state.q, state.u).markers["tip"].position

    (word,) = told(fm.equilibrium, bent(force=4.0))
    enough = int(re.search(r"(\d+) polynomials of", word)[1])
    truth = tip(enough + 3)
    assert np.linalg.norm(tip(enough) - truth) < 0.1 * ALLOWED < np.linalg.norm(tip(2) - truth)
    assert told(fm.equilibrium, bent(enough, force=4.0)) == [] == told(fm.equilibrium, bent(force=0.5))


# Scenes of the library that warn although what is left out is less: of the twisted beam's tip 8e-3 m (5.6e-2 are
# named), of the spaghetti's 1e-3 m of 10 (3.3e-2): the last coefficients also carry what the motion averages.
PESSIMISTIC = {"cases/beams/twisted/scene.toml", "cases/large_deflection/flying_spaghetti/exact.toml"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "path", sorted(path.relative_to(ROOT) for path in (ROOT / "cases").rglob("*.toml") if "exact" in path.read_text()
                   and 'level = "exact"' in path.read_text()), ids=str,
)  # fmt: skip
def test_sound_scenes_are_silent(path):
    """A tenth of a second of each case's scene, at rest and in motion, and its start."""
    try:
        scene = fm.load_scene(ROOT / path)
    except fm.SceneError:
        return  # a file of runs, or one that a case changes before it is a scene
    assert not [each for each in fm.check_scene(scene) if each.waiver in WAIVERS]
    said = told(lambda scene: fm.simulate(scene, 0.1, "radau5", samples=11, rtol=1e-3, atol=1e-5), scene)
    assert said == [] or (path.as_posix() in PESSIMISTIC and ["bends more finely" in each for each in said] == [True])


LENGTH, EA, MASS, GRAVITY = 1.0, 60.0, 0.6, 9.81
HUNG = MASS * GRAVITY * LENGTH / (2.0 * EA)  # 4.9 % of the length


def rod(families: tuple[Family, ...] | None = None, EA: float = EA) -> fm.Scene:
    """Hanging along its axis."""
    section = fm.BeamStation(
        x_m=0.0, EA_N=EA, EIy_Nm2=0.5, EIz_Nm2=0.5, GJ_Nm2=0.5, mass_per_length_kg_m=MASS,
        rotary_y_kg_m=1e-4, rotary_z_kg_m=1e-4,
    )  # fmt: skip
    made = fm.SceneBuilder("rod", gravity=(GRAVITY, 0.0, 0.0), allow=("wave_speed", "thick_section"))
    modes = fm.Modes(count=4, families=families)
    made.beam("rod", length=LENGTH, elements=8, section=section, modes=modes, level="exact")
    return made.weld("mount", "ground", "rod").marker("tip", "rod", node="tip").scene()


def said(scene: fm.Scene) -> list[str]:
    """By an equilibrium and by a run."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        state = fm.equilibrium(scene)
        fm.simulate(scene, 0.01, samples=3, state=state)
    return [str(each.message) for each in found if "held against stretch" in str(each.message)]


def test_a_hanging_rod_of_default_families_says_what_it_leaves_out() -> None:
    found = said(rod())
    assert len(found) == 2  # of the equilibrium, of the run
    assert all(f"lengthen it by {HUNG:.2g} of its length" in each and '"axial"' in each for each in found)


def test_the_remedy_gives_the_closed_form() -> None:
    scene = rod(("axial", "bending_y"))
    assert said(scene) == []
    state, system = fm.equilibrium(scene), fm.compile(scene)
    tip = system.evaluate(0.0, state.q, state.u).markers["tip"].position
    np.testing.assert_allclose(tip, [LENGTH + HUNG, 0.0, 0.0], atol=1e-12)


def test_nothing_is_said_of_little_and_where_it_is_waived() -> None:
    assert said(rod(EA=60.0 * EA)) == []  # 8e-4
    assert said(replace(rod(), allow=(*rod().allow, "held_stretch"))) == []


@pytest.mark.parametrize("rate", [3.0, 0.3])
def test_a_spinning_rod_is_pulled(rate: float) -> None:
    """A free one, whose hinge carries nothing: N = m w^2 (L^2 / 4 - s^2) / 2 at s from its middle."""
    scene = replace(rod(), gravity_m_s2=(0.0, 0.0, 0.0), hinges=())
    free = fm.Free(name="free", parent="ground", child="rod", angular_velocity_rad_s=(0.0, 0.0, rate),
                   velocity_m_s=(0.0, -rate * LENGTH / 2.0, 0.0))  # fmt: skip
    scene = replace(scene, hinges=(free,))
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        fm.simulate(scene, 0.01, samples=3)
    words = [str(each.message) for each in found if "held against stretch" in str(each.message)]
    stretch = MASS * rate**2 * LENGTH**2 / (12.0 * EA)
    assert words == [] if stretch < 1e-3 else f"lengthen it by {stretch:.2g} of" in words[0]


@pytest.mark.parametrize("first", [np.nan, 1e5])
def test_a_state_with_a_large_bound_hides_no_other(monkeypatch: pytest.MonkeyPatch, first: float) -> None:
    """Loads may be undetermined, or act across the beam, in the state with the largest bound, and not in the next."""
    system = fm.compile(rod(EA=1e6))

    def stretched(_: fm.System, body: fm.BeamBody, state: fm.State) -> held_stretch.Unstretched:
        return held_stretch.Unstretched(body.name, state.t, 1e-5 if state.t < 2.0 else 2e-3)

    monkeypatch.setattr(held_stretch, "_stretched", stretched)
    q, u, load = np.zeros((3, system.nq)), np.zeros((3, system.nu)), np.zeros((3, 6))
    load[:, 3] = first, 9e4, 8e4
    (found,) = held_stretch.unstretched(system, np.arange(3.0), q, u, {"mount": load})
    assert found.t == 2.0 and found.strain == 2e-3


FLEX = s.BeamStation(x_m=0.0, EA_N=1e5, EIy_Nm2=40.0, EIz_Nm2=25.0, GJ_Nm2=25.0, mass_per_length_kg_m=1.0)


def few(modes=3, torque=1.0, direction=(1.0, 0.0, 0.0), level="full", turned=False, kind="torque"):
    """A beam of length 1 under a load on its tip; turned: its axis is World's y."""
    builder = fm.SceneBuilder("few").beam("rod", length=1.0, elements=8, section=FLEX, modes=modes, level=level)
    quarter = np.sqrt([0.5, 0.0, 0.0, 0.5])
    builder.weld("hub", "ground", "rod", parent_quaternion=quarter if turned else (1.0, 0.0, 0.0, 0.0))
    getattr(builder, kind)("push", "rod", node="tip", direction=direction, function=fm.Constant(value=torque))
    return builder.marker("tip", "rod", node="tip").scene()


@pytest.mark.parametrize("door", QUICK + ("check_scene",))
@pytest.mark.parametrize("level", ["ruthless", "linear", "full", "stiffened"])
def test_a_load_that_no_mode_answers_is_told_of(door, level):
    """With the closed form of what it would do, T L / GJ."""
    ask = {"check_scene": lambda scene: warned_by(fm.check_scene(scene))}.get(door, ANSWERS[door])
    (word,) = told(ask, few(level=level))
    assert 'none of torsion, in which its load "push" would move its node by up to 0.04 rad' in word
    assert told(ask, replace(few(level=level), allow=("few_modes",))) == []
    assert told(ask, few(s.Modes(count=3, static=True), level=level)) == []


@pytest.mark.parametrize(
    "given, words",
    [
        ({"torque": 0.07}, None),  # turns it by less than 3e-3
        ({"direction": (0.0, 0.0, 1.0)}, None),  # bends it, in modes that it has
        ({"turned": True}, None),
        ({"turned": True, "direction": (0.0, 1.0, 0.0)}, "up to 0.04 rad"),
        ({"kind": "force", "torque": 200.0}, "none of axial, .* by up to 0.002 of its length"),
        ({"kind": "force", "torque": 90.0}, None),
        ({"modes": s.Modes(count=1), "direction": (0.0, 1.0, 0.0)}, "none of bending_z, .* by up to 0.025 rad"),
    ],
)
def test_what_modes_leave_out_depends_on_the_load(given, words):
    answers = told(fm.equilibrium, few(**given))
    assert (answers == []) if words is None else re.search(words, answers[0]), answers


@pytest.mark.parametrize("angle, told_of", [(np.pi / 2.0, True), (0.0, False)])
def test_a_load_in_world_axes_is_looked_at_wherever_the_beam_turns(angle, told_of):
    """A torque about World's y bends the beam at the start, and would twist it a quarter turn later."""
    scene = few(direction=(0.0, 1.0, 0.0))
    turn = fm.SmoothStep(start_value=0.0, end_value=angle, start_s=0.0, duration_s=1.0)
    hub = fm.Revolute(name="hub", parent="ground", child="rod", axis=(0.0, 0.0, 1.0),
                      rotation=fm.AngularCoordinate(prescribed_rad=turn))  # fmt: skip
    answers = told(lambda scene: fm.simulate(scene, 1.0, samples=11, rtol=1e-4), replace(scene, hinges=(hub,)))
    assert any("none of torsion" in answer for answer in answers) is told_of, answers


def frame(modes=3, force=2.0, joint="weld", level="full"):
    """An L in the plane of x and y, whose second side is turned by half the force times 1 m about the axis of the first
    one, and twists it: across a weld, or through a closure in its place."""
    quarter = np.sqrt([0.5, 0.0, 0.0, 0.5])
    builder = fm.SceneBuilder("frame", gravity=(0.0, 0.0, 0.0)).beam(
        "stem", length=1.0, elements=8, section=FLEX, modes=modes, level=level
    )
    builder.weld("clamp", "ground", "stem").rigid_body("arm", mass=1.0, com=(0.25, 0, 0), inertia=(0.01, 0.02, 0.02))
    if joint == "weld":
        builder.weld("corner", "stem", "arm", parent_node="tip", parent_quaternion=quarter)
    else:
        builder.free("floating", "ground", "arm", position=(1.0, 0.0, 0.0), quaternion=quarter)
        builder.closure("corner", "weld", "stem", "arm", node_a="tip", quaternion_a=quarter)
    builder.force("push", "arm", node="origin", direction=(0, 0, -1), function=fm.Constant(value=force))
    builder.torque("turn", "arm", node="origin", direction=(1, 0, 0), function=fm.Constant(value=-0.5 * force))
    return builder.marker("tip", "stem", node="tip").scene()


def by_batch(scene):
    return fm.simulate_batch([scene, scene], 0.02, samples=3, rtol=1e-4)


@pytest.mark.parametrize("joint", ["weld", "closure"])
@pytest.mark.parametrize("door", [fm.equilibrium, lambda scene: fm.linearize(scene, fm.equilibrium(fm.compile(scene)))])
def test_what_a_beam_is_joined_to_would_twist_it(joint, door):
    """With the closed form T L / GJ = 2 N x 0.5 m x 1 m / 25 N m2, and the remedy has it."""
    words = told(door, frame(joint=joint))
    assert any("none of torsion, in which what it is joined to, at t = 0 s, would move its node by up to 0.04 rad" in
               word for word in words), words  # fmt: skip
    assert told(door, frame(joint=joint, force=0.14)) == []  # turns it by less than 3e-3
    assert told(door, replace(frame(joint=joint), allow=("few_modes",))) == []
    cured = frame(s.Modes(count=3, static=True), joint=joint)
    assert told(door, cured) == []
    state, system = fm.equilibrium(cured), fm.compile(cured)
    tip = system.evaluate(0.0, state.q, state.u).markers["tip"]
    assert 2.0 * tip.quaternion[1] == pytest.approx(-0.04, rel=1e-3)


@pytest.mark.parametrize("door", [lambda scene: fm.simulate(scene, 0.02, samples=3, rtol=1e-4), by_batch])
def test_runs_tell_of_what_twists_their_beams_in_motion(door):
    """Across the weld goes what accelerates the arm, too."""
    assert any("none of torsion, in which what it is joined to" in word for word in told(door, frame(force=20.0)))
    assert not any("none of torsion" in word for word in told(door, frame(s.Modes(count=3, static=True), force=20.0)))
