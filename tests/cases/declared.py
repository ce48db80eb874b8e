"""What the run file of a case leaves open, from its declarations alone: no engine runs.

A channel that an engine may offer of a scene is judged by a goal of a comparison, by a conserved quantity or by the
stored reference, or the case leaves it open and says why. `python -m tests.cases.declared [CASE...]` lists the rest.
"""

import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass

from crosscheck.engines.contract import ENERGIES
from crosscheck.engines.exudyn import ExudynBeamEngine
from crosscheck.engines.linear.parts import DERIVATIVES, FREQUENCIES
from crosscheck.engines.registry import OWN_CODE
from crosscheck.judging.unjudged import TOLD_BY
from crosscheck.library.case import TAKES_APART, RunFile, Variant
from crosscheck.library.channels import CONSERVED, KINDS, most_specific
from crosscheck.library.find import Case, load_case, shipped_folder, shipped_names
from crosscheck.library.reference import KNOWLEDGE, has_reference
from crosscheck.library.selection import expected_otherwise, goals_for_reference, select
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.events import Latch
from flexmb.scene.schema import BeamBody, Scene

GIVES_NONE = {
    "exudyn": ("work", "derivatives"), "exudyn-beam": ("work", "derivatives"), "mujoco": ("work",),
    "native-frisch": ("derivatives.by_force",), "native-frisch-as-printed": ("derivatives.by_force",),
}  # fmt: skip
"""What an engine never offers. Should it begin to, strict sessions are red until a case judges it or leaves it open."""
PARTS = {kind.name: [part.name for part in kind.parts] for kind in KINDS}


@dataclass(frozen=True)
class Left:
    """A channel that nothing judges though an engine may offer it.

    `said`: `[[open]]` leaves it open; `otherwise`: of the whole run the case expects agreement with nothing.
    """

    variant: str
    engine: str
    channel: str
    said: bool
    otherwise: bool

    @property
    def open(self) -> bool:
        """Whether the case leaves it open."""
        return self.said or self.otherwise


def offered(scene: Scene, variant: Variant, engine: str) -> list[str]:
    """Every channel that the engine may offer: names as `crosscheck.engines.trajectories` gives them.

    Of a beam that is taken apart a made-up joint stands for those between its parts. Exudyn's beams in a plane have
    neither energies nor momentum, those in space have both. Loads of point masses are given by flexmb alone.
    """
    joints = [item.name for item in (*scene.hinges, *scene.constraints)]
    joints += [item.name for item in scene.point_masses if engine in OWN_CODE]
    apart = scene.bodies if variant.transform in TAKES_APART else ()
    joints += [f"{body.name}.between" for body in apart if isinstance(body, BeamBody)]
    items = {
        "marker": [item.name for item in scene.markers], "load": joints,
        "wheel_load": [item.name for item in scene.wheels], "drive": list(_driven(scene)),
        "connector": [item.name for item in scene.connectors if isinstance(item, BetweenNodes)],
        "hinge_force": [item.name for item in scene.connectors if not isinstance(item, BetweenNodes)],
    }  # fmt: skip
    found = [
        f"{kind}:{name}" + (f".{part}" if part else "")
        for kind, names in items.items()
        for name in names
        for part in PARTS[kind]
    ]
    found += [f"energy.{kind}" for kind in (*ENERGIES, "total")] + ["momentum.angular", "momentum.linear", "work"]
    found += [f"derivatives.{name}" for name in DERIVATIVES] if "derivatives" in variant.asks else []
    found += [FREQUENCIES] if "frequencies" in variant.asks else []
    none = GIVES_NONE.get(engine, ())
    if engine == ExudynBeamEngine.name and ExudynBeamEngine().supports(scene).reason.startswith("a planar beam"):
        none += ("energy", "momentum")
    return [name for name in found if most_specific(none, name) is None]


def _driven(scene: Scene) -> Iterator[str]:
    """Items with a coordinate that is prescribed, or that an event holds."""
    latched = {
        action.coordinate.rpartition(".")[0]
        for event in scene.events
        for action in event.actions
        if isinstance(action, Latch)
    }
    for item in (*scene.hinges, *scene.wheels, *scene.point_masses):
        motions = [getattr(freedom, "coordinate", None) for freedom in item.freedoms]
        held_there = item.name in latched
        if held_there or any(getattr(motion, "prescribed", None) is not None for motion in motions):
            yield item.name


def judged(run: RunFile, variant: str, engine: str) -> set[str]:
    """The patterns of channels that comparisons and conserved quantities of a run file without `asked` name."""
    found = {
        pattern
        for item in run.comparisons
        for side in item.sides
        if (side.variant, side.engine) == (variant, engine)
        for pattern in item.goals
    }
    for item in run.conservations:
        if item.variant == variant and engine in item.engines:
            channel = CONSERVED[item.quantity]
            found |= {channel, TOLD_BY.get(channel, channel)}
    return found


def by_reference(case: Case, variant: str, engine: str) -> set[str]:
    """The channels of an engine that the stored reference judges."""
    recipe = case.run.reference
    if recipe is None or recipe.variant != variant or not has_reference(case.folder):
        return set()
    goals = goals_for_reference(case.run, (engine,)).get(engine)
    if goals is None:
        return set()
    stored = tomllib.loads((case.folder / KNOWLEDGE).read_text(encoding="utf-8"))["channels"]
    return {name for name in stored if most_specific(goals[0], name) is not None}


def left(case: Case) -> Iterator[Left]:
    """Everything that the case does not judge."""
    run = select(case.run, ())
    for variant in run.variants:
        scene = case.scene(variant)
        for engine in variant.engines:
            channels = offered(scene, variant, engine)
            patterns, known = judged(run, variant.name, engine), by_reference(case, variant.name, engine)
            opened = [pattern for item in run.open if item.concerns(variant.name, engine) for pattern in item.channels]
            otherwise = expected_otherwise(run, variant.name, engine) is not None
            for channel in channels:
                if channel not in known and most_specific(patterns, channel) is None:
                    said = most_specific(opened, channel) is not None
                    yield Left(variant.name, engine, channel, said, otherwise)


def idle(case: Case) -> list[str]:
    """Patterns of `[[open]]` that name nothing that is left."""
    found, open_ = list(left(case)), []
    for number, item in enumerate(case.run.open):
        mine = [each.channel for each in found if item.concerns(each.variant, each.engine) and not each.otherwise]
        open_ += [
            f"open[{number}]: {pattern}"
            for pattern in item.channels
            if not any(most_specific([pattern], channel) for channel in mine)
        ]
    return open_


def main(names: list[str]) -> None:
    for name in names or shipped_names():
        case = load_case(shipped_folder() / name)
        for each in left(case):
            if not each.open:
                print(f"{name}, {each.variant}, {each.engine}: {each.channel}")
        for text in idle(case):
            print(f"{name}: {text} names nothing that is left")


if __name__ == "__main__":
    main(sys.argv[1:])
