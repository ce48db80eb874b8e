"""A run that is taken up where another ended is, to the last bit, one that had never ended. Restarts that are
damaged, made up, or changed are refused with what is wrong, before anything runs."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flexmb as fm
from flexmb.control.schedule import LoopMemory
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.integrate.memory import DONE, FRESH, STEP, STRETCH, TIME, Memory
from flexmb.run.warm_up import looped
from flexmb.scene.shapes import beam_section
from tests.flexmb.control.scenes import pendulum
from tests.flexmb.run.test_kept import numbers

TIMES = np.linspace(0.0, 1.0, 21)
CUT = 9


def swinging() -> fm.Scene:
    """A flexible rod under a torque that knows the time, with a quaternion, a spring and a damper beside it."""
    strip = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700.0)
    return (
        fm.SceneBuilder("swinging", gravity=(0.0, 0.0, -9.81))
        .rigid_body("hub", mass=2.0, inertia=(0.1, 0.2, 0.3), com=(0.1, 0.0, 0.2))
        .beam("rod", length=1.0, elements=4, section=strip, modes=3)
        .spherical("ball", "ground", "hub", angular_velocity=(0.3, -0.4, 2.0))
        .revolute("arm", "hub", "rod", axis=(0.0, 1.0, 0.0), angle=0.5, stiffness=3.0, damping=0.01,
                  torque=fm.Sine(amplitude=0.2, angular_frequency_rad_s=3.0))
        .marker("end", "rod", node="tip")
        .scene()
    )  # fmt: skip


def options(method: str) -> dict:
    return {"step": 0.004} if INTEGRATORS[method].fixed else {"rtol": 1e-6, "atol": 1e-8}


@pytest.fixture(scope="module")
def systems() -> dict[str, fm.System]:
    return {"tree": fm.compile(swinging()), "closed": fm.compile(looped())}


def taken_up(system, method, first, times):
    return fm.simulate(system, 1.0, method, t_start=times[0], state=first, samples=times, **options(method))


CASES = [(scene, name) for scene in ("tree", "closed") for name in INTEGRATORS]


@pytest.mark.parametrize(("scene", "method"), CASES)
def test_two_runs_are_one(systems, scene, method, tmp_path):
    system, given = systems[scene], options(method)
    whole = fm.simulate(system, 1.0, method, samples=TIMES, **given)
    assert whole.finished
    first = fm.simulate(system, TIMES[CUT], method, samples=TIMES[: CUT + 1], **given)
    first.restart.save(tmp_path / "first.npz")
    restart = fm.Restart.load(tmp_path / "first.npz")
    cut = int(np.searchsorted(TIMES, restart.since))  # what lies in the step that was cut short comes again
    assert CUT - 1 <= cut <= CUT and restart.t == TIMES[CUT]
    second = taken_up(system, method, restart, TIMES[cut:])
    for part, all_of_it in zip(numbers(second), numbers(whole), strict=True):
        if part.ndim != 2 or part.shape[1] != 4:  # quaternions of markers: their sign is of the run
            assert np.array_equal(part, all_of_it[cut:])
    assert np.array_equal(first.q[:cut], whole.q[:cut]) and np.array_equal(first.u[:cut], whole.u[:cut])
    # What follows knows nothing of where the run was cut.
    assert np.array_equal(second.restart.memory.numbers[1:], whole.restart.memory.numbers[1:])
    assert np.array_equal(second.restart.memory.y, whole.restart.memory.y)


@pytest.mark.parametrize("method", list(INTEGRATORS))
def test_a_run_that_was_stopped_goes_on(systems, method):
    system, given = systems["tree"], options(method)
    whole = fm.simulate(system, 1.0, method, samples=TIMES, **given)
    steps = whole.statistics.accepted_steps + whole.statistics.rejected_steps
    stopped = fm.simulate(system, 1.0, method, samples=TIMES, max_steps=steps // 2, **given)
    assert stopped.status is fm.Status.MAX_STEPS and stopped.restart.t == stopped.stopped_at
    left = TIMES[stopped.t[-1] < TIMES]
    rest = taken_up(system, method, stopped.restart, [stopped.restart.t, *left])
    assert np.array_equal(rest.q[1:], whole.q[len(stopped.t) :])
    assert np.array_equal(rest.work[1:], whole.work[len(stopped.t) :])


@pytest.mark.parametrize("method", ["dop853", "rk4", "generalised_alpha"])
def test_a_switch_where_a_run_is_cut(method):
    """A pulse that begins there is seen by the second run only, in one run as in two."""
    scene = fm.SceneBuilder("pushed").rigid_body("body", mass=2.0, inertia=(1.0, 1.0, 1.0))
    pulse = fm.Pulse(value=3.0, start_s=TIMES[CUT], duration_s=0.2)
    system = fm.compile(scene.prismatic("rail", "ground", "body", force=pulse, stiffness=4.0).scene())
    given = options(method)
    whole = fm.simulate(system, 1.0, method, samples=TIMES, **given)
    first = fm.simulate(system, TIMES[CUT], method, samples=TIMES[: CUT + 1], **given)
    second = taken_up(system, method, first.restart, TIMES[CUT:])
    assert np.all(first.q == 0.0) and np.all(whole.q[CUT + 1 :] != 0.0)
    assert np.array_equal(second.q, whole.q[CUT:]) and np.array_equal(second.work, whole.work[CUT:])


def test_a_state_alone_is_less_than_a_restart(systems):
    """The control: from the last state, without memory, the bits differ."""
    system = systems["tree"]
    whole = fm.simulate(system, 1.0, samples=TIMES, **options("dop853"))
    first = fm.simulate(system, TIMES[CUT], samples=TIMES[: CUT + 1], **options("dop853"))
    second = fm.simulate(system, 1.0, state=first.last_state, samples=TIMES[CUT:], **options("dop853"))
    assert not np.array_equal(second.q[1:], whole.q[CUT + 1 :])
    assert np.allclose(second.q, whole.q[CUT:], rtol=0.0, atol=1e-4)


def test_a_run_that_failed_has_no_restart():
    sprung = fm.SceneBuilder("sprung too hard").rigid_body("body", mass=1.0, inertia=(1.0, 1.0, 1.0))
    scene = sprung.prismatic("rail", "ground", "body", stiffness=1e30, position=1.0).scene()
    run = fm.simulate(scene, 1e3, "rk4", step=1.0)
    assert not run.finished and run.restart is None


def test_what_cannot_be_taken_up_is_refused(systems, tmp_path):
    system = systems["closed"]
    run = fm.simulate(system, 0.1, samples=2, rtol=1e-6)
    with pytest.raises(ValueError, match='made by method "dop853"'):
        fm.simulate(system, 0.2, "rk4", step=0.01, state=run.restart)
    with pytest.raises(ValueError, match="with other contents"):
        fm.simulate(systems["tree"], 0.2, state=run.restart)
    with pytest.raises(ValueError, match="or give a time between"):
        fm.simulate(system, 0.2, t_start=0.0, state=run.restart)
    with pytest.raises(fm.SceneError, match="after its start at 0.1 s"):
        fm.simulate(system, 0.1, state=run.restart)
    (tmp_path / "other.npz").write_bytes(b"nothing")
    with pytest.raises(ValueError, match="no restart"):
        fm.Restart.load(tmp_path / "other.npz")
    run.to_npz(tmp_path / "run.npz")
    with pytest.raises(ValueError, match="no restart"):
        fm.Restart.load(tmp_path / "run.npz")


SAMPLED = fm.StateSpace(
    name="law", inputs=("angle", "rate"), A=((0.5,),), B=((1.0, 0.0),), C=((-2.0,),), D=((-3.0, -0.5),), period_s=0.1,
    delay_s=0.05,
)  # fmt: skip
CONTINUOUS = fm.StateSpace(name="slow", inputs=("angle",), A=((-2.0,),), B=((1.0,),), C=((-0.1,),))
END = 0.4


class Stopped:
    """A system, and how a run of it that stopped is taken up."""

    def __init__(self, scene: fm.Scene, method: Any = "dop853", steps: int = 13, **settings: Any) -> None:
        self.system, self.method, self.settings = fm.compile(scene), method, settings
        first = fm.simulate(self.system, END, method, samples=5, max_steps=steps, **settings)
        assert first.status is fm.Status.MAX_STEPS and first.restart is not None
        self.restart = first.restart
        self.times = [self.restart.t, *np.linspace(0.0, END, 5)[len(first.t) :]]

    def go_on(self, restart: fm.Restart, **settings: Any) -> fm.Trajectory:
        return fm.simulate(
            self.system, END, self.method, state=restart, **{"samples": self.times, **self.settings, **settings}
        )


def test_a_damaged_file_is_told_by_its_array_or_its_table(tmp_path: Path) -> None:
    """Not by what the library that unpacks it says."""
    run = fm.simulate(swinging(), 0.1, samples=2)
    assert run.restart is not None
    run.restart.save(tmp_path / "restart.npz")
    good = (tmp_path / "restart.npz").read_bytes()
    with zipfile.ZipFile(tmp_path / "restart.npz") as archive:
        at = archive.getinfo("y.npy").header_offset
    y = bytearray(good)
    y[good.index(b"\x93NUMPY", at) + 130] ^= 0xFF
    for data, said in (
        (bytes(y), '"y" is damaged: its bytes were changed or cut off'),
        (good[:-40], "its table of contents is damaged or cut off"),
    ):
        (tmp_path / "restart.npz").write_bytes(data)
        with pytest.raises(ValueError, match=r"restart\.npz holds no restart of a run") as refused:
            fm.Restart.load(tmp_path / "restart.npz")
        assert said in str(refused.value) and "CRC" not in str(refused.value)


@pytest.fixture(scope="module")
def runs() -> dict[str, Stopped]:
    looped = pendulum(SAMPLED, CONTINUOUS, torque=fm.ControlSignal(source="law")).scene()
    return {
        "adapting": Stopped(swinging(), rtol=1e-7),
        "equal": Stopped(swinging(), "rk4", 33, step=0.004),
        "stiff": Stopped(swinging(), "radau5", rtol=1e-6),
        "controlled": Stopped(looped, "rk4", step=0.012),
    }


def put(part: str, place: int, value: float) -> Callable[[fm.Restart], fm.Restart]:
    """One number of the memory is another."""

    def changed(restart: fm.Restart) -> fm.Restart:
        values = getattr(restart.memory, part).copy()
        values.flat[place] = value
        return replace(restart, memory=restart.memory._replace(**{part: values}))

    return changed


def memory(**parts: Any) -> Callable[[fm.Restart], fm.Restart]:
    return lambda restart: replace(restart, memory=restart.memory._replace(**parts))


def known(**parts: Any) -> Callable[[fm.Restart], fm.Restart]:
    return lambda restart: replace(restart, controllers=restart.controllers._replace(**parts))


def of(**parts: Any) -> Callable[[fm.Restart], fm.Restart]:
    return lambda restart: replace(restart, **parts)


def in_place(restart: fm.Restart) -> fm.Restart:
    """Shapes of arrays can be changed in place."""
    return replace(restart, memory=restart.memory._replace(y=restart.memory.y.reshape(1, -1)))


LENGTHS = (0, 1, 2, 9, 12, 61, 2000)
WRONG = {
    **{f"y of {n}": memory(y=np.zeros(n)) for n in LENGTHS},
    **{f"rows of {n}": memory(rows=np.zeros((n, n))) for n in (1, 2, 7)},
    **{f"numbers of {n}": memory(numbers=np.zeros(n)) for n in (0, 1, 10, 12)},
    **{f"{x} in {part}": put(part, 0, x) for part in ("y", "numbers") for x in (np.nan, np.inf, -np.inf)},
    "NaN as the next step": put("numbers", STEP, np.nan), "a negative step": put("numbers", STEP, -1e-3),
    "a switch of 2": put("numbers", FRESH, 2.0), "before its stretch": put("numbers", TIME, -1.0),
    "after its end": put("numbers", TIME, 10.0), "no time": put("numbers", TIME, np.nan),
    "a stretch of NaN": put("numbers", STRETCH, np.nan), "half a step done": put("numbers", DONE, 0.5),
    "steps done": put("numbers", DONE, -1000.0), "all steps done": put("numbers", DONE, 1e300),
    "objects": memory(y=np.array([None])), "text": memory(y=np.array(["a"])), "complex": memory(y=np.zeros(3, complex)),
    "None": memory(y=None), "a list of lists": memory(y=[[1.0], [1.0, 2.0]]), "in a column": in_place,
    "masked": lambda each: memory(y=np.ma.array(each.memory.y, mask=True))(each),
    "no memory": of(memory=None), "a tuple": lambda each: replace(each, memory=tuple(each.memory)),
    "t of NaN": of(t=np.nan), "t of text": of(t="1"), "t early": of(t=-1.0), "no scene": of(scene=None),
    "another method": of(method="exponential"), "no method": of(method="euler"), "a number as method": of(method=5),
    "controllers of nothing": of(controllers=LoopMemory(*[np.zeros(1)] * 4)), "of a list": of(controllers=[]),
}  # fmt: skip


@pytest.mark.parametrize("kind", ["adapting", "equal", "stiff", "controlled"])
def test_what_no_run_has_left_is_refused(runs, kind):
    run = runs[kind]
    assert run.go_on(run.restart).finished  # the control
    for name, wrong in WRONG.items():
        with pytest.raises((ValueError, TypeError)) as caught:
            run.go_on(wrong(run.restart))
        assert len(str(caught.value)) > 20, name


@pytest.mark.parametrize("change", [
    *({"instants": np.array([float(n)])} for n in (-1000, -1, 1, 2, 4, 7, 1e7, 1e15, 1e300, np.nan, np.inf, 1.5)),
    {"instants": np.zeros(0)}, {"instants": np.zeros(2)}, {"instants": None},
    *({"signal": np.zeros(n)} for n in (0, 1, 2, 3, 5, 100)), {"signal": np.zeros((1, 4))},
    {"signal": np.full(4, np.nan)},
    *({"state": np.zeros(n)} for n in (0, 1, 3)), {"state": np.full(2, np.nan)},
    {"held": np.zeros((0, 1))}, {"held": np.zeros((1, 2))}, {"held": np.zeros(3)}, {"held": np.full((3, 1), np.nan)},
], ids=lambda each: f"{each}"[:40])  # fmt: skip
def test_what_no_controller_knows_is_refused(runs, change):
    run = runs["controlled"]
    assert run.restart.controllers.instants[0] == 3.0
    with pytest.raises((ValueError, TypeError)):
        run.go_on(known(**change)(run.restart))


def test_a_loop_without_its_memory_is_refused(runs):
    with pytest.raises(ValueError, match="no memory of controllers"):
        runs["controlled"].go_on(replace(runs["controlled"].restart, controllers=None))


def test_what_is_changed_in_place_is_seen(runs):
    """It was right when it was made."""
    run = runs["adapting"]
    restart = replace(run.restart, memory=Memory(*(each.copy() for each in run.restart.memory)))
    restart.memory.y[0] = np.nan
    with pytest.raises(ValueError, match=r"y\[0\] is nan"):
        run.go_on(restart)


@pytest.mark.parametrize("kind", ["equal", "controlled"])
def test_equal_steps_that_are_divided_otherwise_are_refused(runs, kind):
    """Their times would not follow each other: nobody could tell from the result."""
    run = runs[kind]
    for other in ({"step": 0.0037}, {"samples": [run.restart.t, run.restart.t + 0.003, END]}):
        with pytest.raises(ValueError, match="give those of its own run"):
            run.go_on(run.restart, **other)
    for done in (1.0, run.restart.memory.numbers[DONE] + 1.0):
        with pytest.raises(ValueError, match="give those of its own run"):
            run.go_on(put("numbers", DONE, done)(run.restart))


def rewritten(path: Path, **changed: Any) -> Path:
    """The file with other arrays, or without those that are None."""
    with np.load(path, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file} | changed
    other = path.with_name("other.npz")
    np.savez(other, **{name: values for name, values in arrays.items() if values is not None})
    return other


@pytest.fixture
def saved(runs, tmp_path) -> Path:
    runs["controlled"].restart.save(tmp_path / "restart.npz")
    return tmp_path / "restart.npz"


@pytest.mark.parametrize(("changed", "why"), [
    *(({name: None}, f"there is no '{name}'") for name in ("method", "t", "scene", "numbers", "y", "rows", "held")),
    ({"version": 2}, "of version 2 of the format"), ({"version": np.ones(2)}, "be one value"),
    ({"method": "euler"}, "'euler': use one of"), ({"method": 5}, '"method" holds numbers of type int'),
    ({"method": ["rk4", "rk4"]}, "be one value"), ({"method": "rk4" * 500}, '"method" holds'),
    ({"t": np.nan}, "t is nan"), ({"t": [1.0]}, "be one value"), ({"t": 1j}, "complex"), ({"t": "1"}, "holds numbers"),
    ({"y": np.full(6, np.nan)}, "is nan"), ({"y": np.zeros((2, 3))}, "a row of numbers"), ({"y": ["a"]}, "holds"),
    ({"numbers": np.zeros(12)}, r"\(11,\) is needed"), ({"numbers": np.full(11, np.nan)}, "is nan"),
    ({"rows": np.zeros((3, 6))}, "is needed"), ({"instants": [-1000.0]}, "instants is -1000"),
    ({"scene": np.zeros(9, np.uint8)}, "malformed"), ({"scene": np.zeros(9)}, "not bytes"),
    ({"scene": np.frombuffer(b"{}", np.uint8)}, "missing required field"),
    ({"scene": np.frombuffer(b"[" * 10**5, np.uint8)}, "restart"), ({"more": 1.0}, "is not one of"),
])  # fmt: skip
def test_files_that_hold_something_else_are_refused(saved, changed, why):
    with pytest.raises(ValueError, match=why) as caught:
        fm.Restart.load(rewritten(saved, **changed))
    assert "other.npz holds no restart" in str(caught.value) and "give the restart.npz" in str(caught.value)


def test_a_file_without_a_version_is_read(runs, saved):
    """It was written before there was one."""
    run = runs["controlled"]
    again = run.go_on(fm.Restart.load(rewritten(saved, version=None)))
    assert np.array_equal(again.q, run.go_on(run.restart).q)


def test_cut_and_damaged_files_are_refused(saved):
    """As a run leaves it that is killed while it writes; zip files know the sum of every array."""
    whole, path = saved.read_bytes(), saved.with_name("cut.npz")
    for length in range(0, len(whole), 97):
        path.write_bytes(whole[:length])
        with pytest.raises(ValueError, match="holds no restart"):
            fm.Restart.load(path)
    expected = fm.Restart.load(saved)
    for place in range(0, len(whole), 53):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x10]) + whole[place + 1 :])
        try:
            found = fm.Restart.load(path)
        except ValueError as error:
            assert "holds no restart" in str(error)
        else:  # a date, or what else says nothing of the arrays
            assert all(np.array_equal(a, b) for a, b in zip(found.memory, expected.memory, strict=True))
            assert found.scene == expected.scene and found.t == expected.t


def test_a_bomb_is_not_unpacked(saved, tmp_path):
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (2 * 10**8,)})
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        with zipfile.ZipFile(saved) as sound:
            for name in sound.namelist():
                if name != "y.npy":
                    archive.writestr(name, sound.read(name))
        with archive.open("y.npy", "w", force_zip64=True) as stream:
            stream.write(header.getvalue())
            for _ in range(20):
                stream.write(bytes(10**6))
    with pytest.raises(ValueError, match="more than a file of this size can hold"):
        fm.Restart.load(tmp_path / "bomb.npz")
