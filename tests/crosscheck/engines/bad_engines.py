"""A gallery of bad engines: each breaks the contract, or its process, in one way, and has the one status it must get.

`ANSWERS` break the contract, `CRASHES` their process, `ENDLESS` and `HUNGRY` do not end; `MODULES` are texts of plug-in
modules that do not load. `TIDY` and `UNTIDY` behave strangely but rightly, in what they answer and with their process.
Every engine is a sound pendulum (`fake_engines`) but for its one fault.
"""

import ctypes
import itertools
import locale
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.contract import Effort, MarkerPath, Run, Trajectory
from flexmb.scene.schema import Scene
from tests.crosscheck.fake_engines import STEPS, TOLERANCES, Fake, Pendulum

LADDER = TOLERANCES[:3]  # short runs, which are repeated


@dataclass(frozen=True)
class Bad:
    """An engine, the status its runs must get, and words of the reason."""

    status: str
    words: str
    make: Callable[[], Any]


class Faulty(Fake):
    """`simulate` of its models is replaced by `fault(pendulum, run, effort)`; other methods by what `methods` names."""

    def __init__(self, name: str, fault: Callable[..., Any] | None, methods: dict[str, Callable[..., Any]]) -> None:
        super().__init__(name, LADDER)
        self.fault = fault
        for method, function in methods.items():
            setattr(self, method, function)

    def compile(self, scene: Scene) -> Pendulum:
        model = Pendulum(scene)
        if self.fault is not None:
            sound = Pendulum(scene)
            model.simulate = lambda run, effort: self.fault(sound, run, effort)  # type: ignore[method-assign]
        return model


def answers(change: Callable[[Trajectory], Any]) -> Callable[..., Any]:
    """A run that is right and then changed."""
    return lambda model, run, effort: change(model.simulate(run, effort))


def tip(**parts: Callable[[np.ndarray], Any]) -> Callable[..., Any]:
    """A run whose marker is changed in some of its parts."""

    def change(done: Trajectory) -> Trajectory:
        path = done.markers["tip"]
        return replace(done, markers={"tip": replace(path, **{key: f(getattr(path, key)) for key, f in parts.items()})})

    return answers(change)


def does(act: Callable[[], Any]) -> Callable[..., Any]:
    """A run that does something first."""

    def run(model: Pendulum, run: Run, effort: Effort) -> Trajectory:
        act()
        return model.simulate(run, effort)

    return run


def throws(error: BaseException) -> Callable[..., Any]:
    def run(*_: Any) -> Any:
        raise error

    return run


def with_nan(values: np.ndarray) -> np.ndarray:
    values = values.copy()
    values[len(values) // 2 :: 3] = np.nan
    return values


def times(change: Callable[[np.ndarray], Any]) -> Callable[..., Any]:
    return answers(lambda done: replace(done, times=change(done.times)))


def noisy(model: Pendulum, run: Run, effort: Effort) -> Trajectory:
    noise = 1e-9 * np.random.default_rng().normal(size=3)
    return tip(position=lambda values: values + noise)(model, run, effort)


class Second:
    """Acts when the same effort is run for the second time."""

    def __init__(self, act: Callable[[], Any]) -> None:
        self.act, self.seen = act, set[Effort]()

    def __call__(self, model: Pendulum, run: Run, effort: Effort) -> Trajectory:
        if effort in self.seen:
            self.act()
        self.seen.add(effort)
        return model.simulate(run, effort)


class Unspeakable(Exception):
    def __str__(self) -> str:
        raise RuntimeError("no text")


class Unusual(BaseException):
    pass


def recurse() -> None:
    recurse()


def nothing(*_: Any) -> None:
    return None


def fall(error: BaseException) -> None:
    raise error


def endless() -> Any:
    return (Effort("tolerance", 2.0**-n, "endless") for n in itertools.count())


def efforts(*values: float) -> dict[str, Callable[..., Any]]:
    ladder = tuple(Effort("tolerance", value, "dop853") for value in values)
    return {"efforts": lambda scene: ladder}


def segmentation_fault() -> None:
    ctypes.string_at(0)


def kill_itself() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def close_everything() -> None:
    os.closerange(3, 4096)
    time.sleep(3600.0)


def _gallery() -> tuple[dict[str, Bad], dict[str, Bad]]:
    """What harms only its own answer, one of a kind (`test_answers_in_detail.py` has every breach of the contract);
    what harms its process."""
    failed: dict[str, tuple[str, Callable[..., Any] | None, dict[str, Callable[..., Any]]]] = {
        # what simulate returns
        "nan_in_some_samples": ("position is not finite at t = 1 s", tip(position=with_nan), {}),
        "times_reversed": ("times[0] is 2 s where 0 s was asked for", times(lambda t: t[::-1]), {}),
        "objects_for_numbers": ("dtype object", tip(position=lambda x: x.astype(object)), {}),
        "text_for_numbers": ("dtype <U", tip(position=lambda x: x.astype(str)), {}),
        "transposed": ("shape (3, 21)", tip(position=lambda x: x.T), {}),
        "quaternion_too_long": ("norm 1.001", tip(quaternion=lambda q: 1.001 * q), {}),
        "count_beyond_all_bounds": ("evaluations is", answers(lambda done: replace(done, evaluations=10**40)), {}),
        "failed_by_itself": (
            "\\ud800 it says", answers(lambda done: replace(done, status="failed", message="\ud800 it says")), {}
        ),
        "returns_none": ("None, not a Trajectory", nothing, {}),
        "returns_a_dict": ("a dict, not a Trajectory", answers(lambda done: vars(done)), {}),
        "noise": ("not reproducible", noisy, {}),
        "fails_when_repeated": ("RuntimeError: once only", Second(lambda: fall(RuntimeError("once only"))), {}),
        # what is raised
        "raises": ("ZeroDivisionError", does(lambda: 1 / 0), {}),
        "exits": ("SystemExit: 0", throws(SystemExit(0)), {}),
        "raises_beyond_exceptions": ("Unusual", throws(Unusual()), {}),
        "raises_what_cannot_be_told": ("Unspeakable: its message cannot be read", throws(Unspeakable()), {}),
        "raises_half_a_letter": ("\\udfff", throws(ValueError("\udfff")), {}),
        "recurses": ("RecursionError", does(recurse), {}),
        "has_no_memory": ("MemoryError", throws(MemoryError()), {}),
        # what the other methods return
        "version_none": ("version() is None, not text", None, {"version": nothing}),
        "version_raises": ("KeyError", None, {"version": lambda: {}["version"]}),
        "supports_true": ("a bool, not a Support", None, {"supports": lambda scene: True}),
        "two_efforts": ("efforts() has 2 efforts", None, efforts(1e-3, 1e-6)),
        "efforts_without_end": ("not a tuple of efforts", None, {"efforts": lambda scene: endless()}),
        "compiles_to_nothing": ("which is no model", None, {"compile": nothing}),
        "warms_up_badly": ("OSError", None, {"compile": lambda scene: Cold(scene)}),
    }  # fmt: skip
    crashed: dict[str, tuple[str, Callable[..., Any]]] = {
        "leaves_with_zero": ("exit code 0", does(lambda: os._exit(0))),
        "segmentation_fault": ("exit code -11", does(segmentation_fault)),
        "aborts": ("exit code -6", does(os.abort)),
        "kills_itself": ("exit code -9", does(kill_itself)),
        "interrupts": ("KeyboardInterrupt", throws(KeyboardInterrupt())),
        "closes_all_files": ("closed its pipe", does(close_everything)),
    }
    return (
        {name: Bad("failed", words, made(name, fault, methods)) for name, (words, fault, methods) in failed.items()},
        {name: Bad("crashed", words, made(name, fault, {})) for name, (words, fault) in crashed.items()},
    )


def made(name: str, fault: Any, methods: dict[str, Any]) -> Callable[[], Faulty]:
    return lambda: Faulty(name, fault, methods)


class Cold(Pendulum):
    def warm_up(self) -> None:
        raise OSError("no cache")


# ---- What does not end by itself


def ignore_and_wait() -> None:
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    while True:
        time.sleep(3600.0)


def eat() -> None:
    kept = []
    while True:
        kept.append(np.ones(2**22))  # 32 MB
        time.sleep(0.002)


def let_a_child_eat() -> None:
    if os.fork() == 0:
        eat()
    time.sleep(3600.0)


ENDLESS = {
    "hangs": Bad("did not finish", "stopped at its limit of", made("hangs", does(ignore_and_wait), {})),
    "hangs_when_repeated": Bad(
        "did not finish", "while at dop853 rtol=1e-06", made("hangs_when_repeated", Second(ignore_and_wait), {})
    ),
}
HUNGRY = {
    "eats_memory": Bad("did not finish", "GB of memory", made("eats_memory", does(eat), {})),
    "its_child_eats": Bad("did not finish", "GB of memory", made("its_child_eats", does(let_a_child_eat), {})),
}

# ---- What is odd, but right


def print_megabytes() -> None:
    sys.stdout.write("x" * 2**21 + "\n")
    os.write(2, b"y" * 2**21)


def read_and_write_stdin() -> None:
    assert os.read(0, 10) == b""
    try:
        os.write(0, b"z")
    except OSError:
        return


def change_everything() -> None:
    os.chdir("/")
    os.environ.clear()
    locale.setlocale(locale.LC_ALL, "C")
    np.seterr(all="ignore")
    warnings.simplefilter("error")
    sys.path.clear()


def leave_a_thread() -> None:
    threading.Thread(target=time.sleep, args=(3600.0,)).start()


def leave_children() -> None:
    """One plain, one in a session of its own; their numbers are kept for the test."""
    for in_own_session in (False, True):
        child = os.fork()
        if child == 0:
            if in_own_session:
                os.setsid()
            time.sleep(3600.0)
            os._exit(0)
        with Path(os.environ["CHILDREN"]).open("a", encoding="utf-8") as diary:
            diary.write(f"{child}\n")


def return_twice() -> None:
    os.fork()


class OneBuffer:
    """All runs are views of one array, which the next run overwrites."""

    def __init__(self) -> None:
        self.buffer = np.empty((100, 3))

    def __call__(self, model: Pendulum, run: Run, effort: Effort) -> Trajectory:
        done = model.simulate(run, effort)
        view = self.buffer[: len(run.times)]
        view[:] = done.markers["tip"].position
        return replace(done, markers={"tip": replace(done.markers["tip"], position=view)})


def overwrite_times(model: Pendulum, run: Run, effort: Effort) -> Trajectory:
    done = model.simulate(Run(run.times.copy()), effort)
    run.times[:] = np.nan
    return done


def with_locked_arrays(done: Trajectory) -> Trajectory:
    for part in ("position", "quaternion", "velocity"):
        getattr(done.markers["tip"], part).setflags(write=False)
    return done


def in_single_precision(done: Trajectory) -> Trajectory:
    path = done.markers["tip"]
    parts = (path.position, path.quaternion, path.velocity)
    return replace(done, markers={"tip": MarkerPath(*(values.astype(np.float32) for values in parts))})


TIDY = {
    "single_precision": made("single_precision", answers(in_single_precision), {}),
    "column_by_column": made("column_by_column", tip(position=np.asfortranarray), {}),
    "read_only": made("read_only", answers(with_locked_arrays), {}),
    "one_buffer": made("one_buffer", OneBuffer(), {}),
    "overwrites_times": made("overwrites_times", overwrite_times, {}),
}
UNTIDY = {
    "prints_megabytes": made("prints_megabytes", does(print_megabytes), {}),
    "uses_stdin": made("uses_stdin", does(read_and_write_stdin), {}),
    "changes_everything": made("changes_everything", does(change_everything), {}),
    "leaves_a_thread": made("leaves_a_thread", does(leave_a_thread), {}),
    "leaves_children": made("leaves_children", does(leave_children), {}),
    "returns_twice": made("returns_twice", does(return_twice), {}),
}

# ---- Plug-ins that cannot be loaded: the texts of their modules; `make` is what the entry point names

MODULES = {
    "module_missing": ("did not run", "No module named 'not_there'", "import not_there"),
    "raises_at_import": ("failed", "plug-in \"raises_at_import\" (raises_at_import:make) cannot be loaded", "1 / 0"),
    "not_python": ("failed", "SyntaxError", "def make(:"),
    "not_text": ("failed", "cannot contain null bytes", "\0"),  # SyntaxError, before Python 3.11.4 ValueError
    "exits_at_import": ("failed", "SystemExit: 0", "import sys; sys.exit(0)"),
    "makes_nothing": ("failed", "a NoneType without name, version", "def make(): pass"),
    "makes_half_an_engine": ("failed", "without efforts, compile", "class make:\n name = ''\n version = supports = 1"),
    "raises_when_made": ("failed", "ValueError: not today", "def make(): raise ValueError('not today')"),
    "lacks_its_factory": ("failed", "AttributeError", "made = 1"),
    "leaves_at_import": ("crashed", "exit code 0", "import os; os._exit(0)"),
    "falls_at_import": ("crashed", "exit code -11", "import ctypes; ctypes.string_at(0)"),
    "interrupts_at_import": ("crashed", "KeyboardInterrupt", "raise KeyboardInterrupt"),
}  # fmt: skip
HANGING_MODULES = {"hangs_at_import": ("did not finish", "while at its start", "import time; time.sleep(3600)")}

ANSWERS, CRASHES = _gallery()
GALLERY = ANSWERS | CRASHES


def __getattr__(name: str) -> Callable[[], Any]:
    """The factory of an engine, as entry points name it."""
    bad, odd = GALLERY | ENDLESS | HUNGRY, TIDY | UNTIDY
    if name in bad:
        return bad[name].make
    if name in odd:
        return odd[name]
    raise AttributeError(name)


def fine() -> Fake:
    return Fake("fine", LADDER)


def stepper() -> Fake:
    return Fake("stepper", STEPS)
