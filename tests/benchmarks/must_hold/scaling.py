"""One evaluation against the number of bodies and of modes: measured into curves, drawn from what is kept."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np

import flexmb as fm
from flexmb.scene.schema import Level
from tests.benchmarks import peers
from tests.benchmarks.must_hold.growth import PARENTS, rigid_tree
from tests.benchmarks.must_hold.kept import Curve, Results, Scaling, now, this_commit, this_machine
from tests.benchmarks.must_hold.native import from_python, kernel
from tests.benchmarks.must_hold.row import Call
from tests.benchmarks.rivals import flexible_chain, rigid_chain, turns
from tests.benchmarks.routes import composite_body
from tests.benchmarks.test_batch import batch
from tests.repo.project import ROOT

FOLDER = ROOT / "docs" / "pictures"
BODIES = (1, 2, 5, 10, 20, 50, 100, 1000)
MODES = (1, 2, 3, 5, 8, 10, 15, 20)
LEVELS: tuple[Level, ...] = ("ruthless", "full")
LONGEST_OF_PEERS = 100  # a thousand bodies take gigabytes in some of them
ROUNDS = 7


@dataclass(frozen=True)
class Picture:
    """What is drawn, and how it is measured: calls by label for each number on the axis."""

    name: str
    title: str
    text: str
    axis: str
    numbers: tuple[int, ...]
    calls: Callable[[int], Iterator[tuple[str, Call]]]


def _of_bodies(bodies: int) -> Iterator[tuple[str, Call]]:
    scene = rigid_chain(bodies)
    if bodies <= LONGEST_OF_PEERS:
        yield "pin.aba, from Python", peers.pinocchio_aba(scene)
        yield "pin.abaInParallel, one thread", peers.aba_in_parallel(scene, 256)
        yield "mj_forward, from Python", peers.mujoco_forward(scene)
        yield "native, from Python", from_python(fm.compile(scene))
        yield "native, batch on one thread", batch(scene, 256)
    for tree in PARENTS:
        yield f"native kernel, {tree}", kernel(fm.compile(rigid_tree(tree, bodies)))


def _of_modes(modes: int) -> Iterator[tuple[str, Call]]:
    for level in LEVELS:
        scene = flexible_chain(10, modes, level)
        system = fm.compile(scene)
        yield f"{level}, recursion", kernel(system)
        yield f"{level}, recursion, batch on one thread", batch(scene, 64)
        yield f"{level}, composite bodies", kernel(system, composite_body)


PICTURES = {
    picture.name: picture
    for picture in (
        Picture(
            "scaling_bodies", "Time of an evaluation against the number of bodies",
            "Rigid bodies on revolute hinges, in a chain where nothing else is said.", "bodies", BODIES, _of_bodies,
        ),
        Picture(
            "scaling_modes", "Time of an evaluation against the number of modes",
            "A chain of ten beams, modes clamped at the root.", "modes of each of ten beams", MODES, _of_modes,
        ),
    )
}  # fmt: skip


def measured_curves(picture: Picture) -> Scaling:
    """All curves, those of one number on the axis in turns."""
    found: dict[str, dict[int, float]] = {}
    for number in picture.numbers:
        calls = dict(picture.calls(number))
        samples = [call.samples for call in calls.values()]
        seconds = np.median(turns(*(call.call for call in calls.values()), rounds=ROUNDS), axis=0) / samples
        for label, value in zip(calls, seconds.tolist(), strict=True):
            found.setdefault(label, {})[number] = 1e6 * value
    curves = [Curve(label, list(points), list(points.values())) for label, points in found.items()]
    return Scaling(now(), this_commit(), this_machine(), curves)


def draw(results: Results, folder: Path = FOLDER) -> None:
    """All pictures whose curves are kept."""
    plt.switch_backend("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "flexmb", "svg.fonttype": "none", "font.size": 9})
    for picture in PICTURES.values():
        if picture.name not in results.scaling:
            continue
        figure, axes = plt.subplots(figsize=(7.2, 4.8), layout="constrained")
        for curve in results.scaling[picture.name].curves:
            style = "-" if "native" in curve.label or "recursion" in curve.label else "--"
            axes.loglog(curve.at, curve.microseconds, f"{style}o", ms=3, label=curve.label)
        axes.set(xlabel=picture.axis, ylabel="one evaluation (µs)", title=picture.title)
        axes.legend(fontsize=8)
        figure.savefig(folder / f"{picture.name}.svg", metadata={"Date": None})
        plt.close(figure)
