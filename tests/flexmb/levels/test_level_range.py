"""Whatever turns a flexible body faster than its level describes says so, with the level to take."""

import re
import warnings
from functools import partial
from typing import get_args

import numpy as np
import pytest
from msgspec.structs import replace
from typer.testing import CliRunner

import flexmb as fm
from flexmb.cli import app
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.ready import scenes
from flexmb.run import lane_runs
from flexmb.scene.bodies import Level, Modes
from flexmb.scene.files import save_scene
from flexmb.scene.shapes import beam_section
from flexmb.system.level_range import ALLOWED, UNPULLED

RULER = beam_section(E=70e9, G=27e9, A=2e-5, Iy=1.7e-12, Iz=6.7e-10, rho=2700.0)
FIRST = 3.5160 * np.sqrt(70e9 * 1.7e-12 / (2700.0 * 2e-5))  # rad/s, of a cantilever of 1 m


def arm(rate: float, level: Level = "full", axis=(0, 0, 1), **motion: object) -> fm.Scene:
    """A ruler of 1 m that turns about its root."""
    modes = Modes(count=4 if level != "exact" else 2)
    builder = fm.SceneBuilder("arm").beam("ruler", length=1.0, elements=8, section=RULER, modes=modes, level=level)
    return builder.revolute("hub", "ground", "ruler", axis=axis, rate=rate, **motion).scene()


def said(scene: fm.Scene, t_end: float = 0.02) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run = fm.simulate(scene, t_end, samples=3)
    words = [str(each.message) for each in caught]
    assert all(issubclass(each.category, fm.SceneWarning) for each in caught)
    assert all(word.split(": ", 1)[1] in run.message for word in words)
    return words


@pytest.mark.parametrize("level", [level for level in get_args(Level) if level != "rigid"])
def test_a_run_beyond_the_range_of_its_level_names_the_level_to_take(level):
    words = said(arm(0.6 * FIRST, level))
    assert len(words) == (1 if level in UNPULLED else 0)
    for word in words:
        assert f'level "{level}"' in word and '"stiffened" or "exact"' in word and "= 0.36" in word
        assert "unstable" not in word


def test_what_turns_slowly_or_about_its_own_axis_is_silent():
    assert said(arm(0.9 * np.sqrt(ALLOWED) * FIRST)) == []
    assert said(arm(3.0 * FIRST, axis=(1, 0, 0))) == []
    (word,) = said(arm(1.5 * FIRST))
    assert "unstable" in word
    assert said(replace(arm(1.5 * FIRST), allow=("level_range",))) == []


TURN_S = 1.875 / (0.6 * FIRST)
"""Of a turn by 1 rad from rest to rest, which is fastest in the middle: 0.6 FIRST."""
STEPS = {"rk4": 1e-3, "generalised_alpha": 2e-3}


def turned(end: float = 1.0) -> fm.SceneBuilder:
    builder = fm.SceneBuilder("arm").beam("ruler", length=1.0, elements=8, section=RULER, modes=Modes(count=4))
    turn = fm.SmoothStep(start_value=0.0, end_value=end, start_s=0.0, duration_s=TURN_S)
    return builder.revolute("hub", "ground", "ruler", axis=(0, 0, 1), prescribed=turn)


def steered(builder: fm.SceneBuilder) -> fm.SceneBuilder:
    builder.marker("tip", "ruler", node="tip").sense_marker("place", "tip", "position").pid("law", "place[1]", kp=0.0)
    return builder.force("push", "ruler", node="tip", direction=(0, 1, 0), function=fm.ControlSignal(source="law"))


@pytest.mark.parametrize("method", INTEGRATORS)
def test_a_turn_between_output_times_is_noticed(method):
    """Both output times are at rest; every method, alone, with a controller, and in two parts."""
    cut = steered(turned()).event("now", "time", 0.45 * TURN_S, fm.Change(path="law.kp", value=0.0))
    for builder in (turned(), steered(turned()), cut):
        with pytest.warns(fm.SceneWarning, match="of its first frequency") as caught:
            run = fm.simulate(builder.scene(), TURN_S, method, samples=2, step=STEPS.get(method), rtol=1e-6, atol=1e-8)
        (text,) = (str(each.message) for each in caught)
        t = float(text.split("at t = ")[1].split(" s")[0])
        assert abs(t - TURN_S / 2.0) < 0.1 * TURN_S and "take level" in run.message
    plain = replace(turned().scene(), allow=("level_range",))
    given = {"samples": 2, "step": STEPS.get(method), "rtol": 1e-6, "atol": 1e-8}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        looked, waived = (fm.simulate(each, TURN_S, method, **given) for each in (turned().scene(), plain))
    assert np.array_equal(looked.q, waived.q) and np.array_equal(looked.loads["hub"], waived.loads["hub"])
    assert fm.simulate(turned(0.6).scene(), TURN_S, method, **given).message.startswith("finished")  # 0.36 FIRST


@pytest.mark.parametrize("make", [scenes.looped_at_rest_shape, partial(scenes.panelled, 2, "full")])
def test_signals_are_watched_while_turns_are(make):
    """The integrator's constants are then those of the record, by which no signal is found."""
    scene = scenes.with_events(make(), "pivot.rotation")
    looked = fm.simulate(scene, 2e-3, "rk4", samples=3, step=2e-4)
    waived = fm.simulate(replace(scene, allow=("level_range",)), 2e-3, "rk4", samples=3, step=2e-4)
    assert np.array_equal(looked.q, waived.q) and {"is held", "is free"} < {event.name for event in looked.events}
    assert [(event.name, event.t) for event in looked.events] == [(event.name, event.t) for event in waived.events]


def test_linear_models_and_campbell_diagrams_warn_once():
    """About the rates of the diagram, also where the scene drives the hub otherwise."""
    for motion in ({}, {"prescribed": fm.Constant(value=0.0)}):
        system = fm.compile(arm(0.0, **motion))
        fm.campbell(system, "hub", [0.0, 0.3 * FIRST])
        with pytest.warns(fm.SceneWarning, match="= 1.4; level .* unstable") as caught:
            fm.campbell(system, "hub", [0.0, 0.3 * FIRST, 0.6 * FIRST, 1.2 * FIRST])
        assert len(caught) == 1
    with pytest.warns(fm.SceneWarning, match="first frequency"):
        fm.steady_spin(system, "hub", 0.6 * FIRST).linearize()
    with pytest.warns(fm.SceneWarning, match="first frequency"):
        fm.linearize(arm(0.6 * FIRST))
    fm.linearize(arm(0.6 * FIRST, "stiffened"))


def test_linear_models_of_closed_loops_warn():
    builder = fm.SceneBuilder("driven").beam("ruler", length=1.0, elements=8, section=RULER, modes=Modes(count=4))
    builder.revolute("hub", "ground", "ruler", axis=(0, 0, 1), rate=0.6 * FIRST).marker("tip", "ruler", node="tip")
    builder.sense_marker("place", "tip", "position").pid("law", "place[1]", kp=0.1)
    builder.force("push", "ruler", node="tip", direction=(0, 1, 0), function=fm.ControlSignal(source="law"))
    for held in (False, True):
        with pytest.warns(fm.SceneWarning, match="first frequency") as caught:
            fm.linearize(builder.scene(), held=held)
        assert len(caught) == 1


def test_batches_warn_once_and_of_the_worst():
    scenes = [arm(share * FIRST) for share in (0.1, 0.6, 0.7, 0.2)]
    system = fm.compile(scenes[0])
    states = np.array([fm.compile(scene).initial_state.u for scene in scenes])
    for copies, given in ((scenes, {}), (system, {"u": states})):
        with pytest.warns(fm.SceneWarning, match='"arm": .*, 0.7 of its first frequency') as caught:
            fm.simulate_batch(copies, 0.02, samples=3, **given)
        assert len(caught) == 1
        assert "(copies 1 to 2; copy 2 is the worst)" in str(caught[0].message)
    fm.simulate_batch([arm(0.6 * FIRST, "stiffened")] * 2, 0.02, samples=3)
    fm.simulate_batch([replace(arm(0.6 * FIRST), allow=("level_range",))] * 2, 0.02, samples=3)


def warned(call, *given, **settings):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call(*given, **settings)
    return [str(each.message) for each in caught]


def of_single_runs(scenes, t_end, method, u=None, **given):
    """What the runs of all copies say, by the number of the copy."""
    found = {}
    for i, scene in enumerate(scenes):
        state = {} if u is None else {"state": fm.compile(scene).state(fm.compile(scene).initial_state.q, u[i])}
        if words := warned(fm.simulate, scene, t_end, method, **given, **state):
            (found[i],) = words
    return found


@pytest.mark.parametrize("method", ["rk4", "dop853", "radau5"])
@pytest.mark.parametrize("apart", [True, False])
def test_batches_warn_of_what_single_runs_warn(method, apart, monkeypatch):
    """The same words, of the same copies, also of turns between output times: in lanes, in the block that is not full,
    of scenes and of states, and of methods without lanes."""
    ends = (1.0, 0.2, 0.9, 0.3, 0.1, 1.05, 0.95, 0.4, 0.5, 1.1)
    scenes = [turned(end).scene() for end in ends] if apart else [arm(0.0, level="linear")] * len(ends)
    u = None if apart else np.outer(ends, fm.compile(arm(0.6 * FIRST, "linear")).initial_state.u)
    given = {"samples": 2, "step": STEPS.get(method), "rtol": 1e-6, "atol": 1e-8}
    alone = of_single_runs(scenes, TURN_S, method, u, **given)
    copies, own = (scenes, {}) if apart else (fm.compile(scenes[0]), {"u": u})
    assert 0 < len(alone) < len(ends)
    (word,) = warned(fm.simulate_batch, copies, TURN_S, method, **given, **own)
    said_of, named = word[:-1].split(" (copies ")
    numbers = [range(int(each[0]), int(each[-1]) + 1) for each in
               (part.split(" to ") for part in named.split("; ")[0].split(", "))]  # fmt: skip
    assert [i for each in numbers for i in each] == list(alone)
    worst = int(named.split("; copy ")[1].split()[0])
    assert worst == 9 and facts(said_of) == pytest.approx(facts(alone[worst]), rel=1e-3)
    if apart:  # negative control: by the output times alone nothing is seen
        monkeypatch.setattr(lane_runs.BatchRun, "_look_at", lambda *_: None)
        monkeypatch.setattr(lane_runs.Alone, "fastest", np.zeros((0, 0)))
        assert warned(fm.simulate_batch, copies, TURN_S, method, **given) == []


def facts(word: str) -> list[float]:
    """Rate, time and shares of a warning."""
    return [float(each) for each in re.findall(r"(?<=[ =])[0-9][0-9.e+-]*(?=[ ;])", word)]


def test_copies_that_waive_the_watch_or_fail_are_not_named():
    scenes = [arm(0.6 * FIRST), replace(arm(0.8 * FIRST), allow=("level_range",)), arm(0.7 * FIRST)]
    (word,) = warned(fm.simulate_batch, scenes, 0.02, samples=3)
    assert "(copies 0, 2; copy 2 is the worst)" in word
    states = np.array([fm.compile(scenes[0]).initial_state.u] * 3)
    states[1] = np.nan
    (word,) = warned(fm.simulate_batch, fm.compile(scenes[0]), 0.02, samples=3, u=states)
    assert "(copies 0, 2; copy 0 is the worst)" in word
    many = [arm((0.6 if i % 2 else 0.1) * FIRST) for i in range(24)]
    (word,) = warned(fm.simulate_batch, many, 0.01, samples=2)
    assert "(copies 1, 3, 5, 7, 9, 11, 13, 15 and 4 more; copy 1 is the worst)" in word


def test_the_check_knows_rates_at_the_start_and_prescribed_ones(tmp_path):
    spun = arm(0.0, prescribed=fm.SpinUp(rate=0.6 * FIRST, duration_s=5.0))
    assert fm.check_scene(spun) == () == fm.check_scene(arm(0.6 * FIRST, "stiffened"))
    for scene, t_end in ((arm(0.6 * FIRST), None), (spun, 10.0)):
        (doubt,) = fm.check_scene(scene, t_end)
        assert doubt.waiver == "level_range" and 'body "ruler"' in doubt.where and "stiffened" in doubt.remedy
        assert fm.check_scene(replace(scene, allow=("level_range",)), t_end) == ()
    save_scene(arm(0.6 * FIRST), tmp_path / "arm.toml")
    assert "level_range" in CliRunner().invoke(app, ["check", str(tmp_path / "arm.toml")]).stderr
    assert CliRunner().invoke(app, ["check", "--strict", str(tmp_path / "arm.toml")]).exit_code == 2


def test_what_is_allowed_changes_the_first_frequency_by_a_tenth():
    """Level full against level exact, in a steady spin with the flapping in its plane of rotation left out."""
    rate = np.sqrt(ALLOWED) * FIRST * 0.999
    frequency = {
        level: min(mode.frequency_hz for mode in fm.steady_spin(arm(0.0, level), "hub", rate).linearize().modes)
        for level in ("full", "exact")
    }
    assert 0.05 < frequency["exact"] / frequency["full"] - 1.0 < 0.15
