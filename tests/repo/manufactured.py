"""The tables of docs/manufactured.md: engines held against manufactured motions, and observed orders. Write them with

python -m tests.repo.manufactured
"""

from collections.abc import Iterator

from crosscheck.engines.contract import EngineMissing
from crosscheck.engines.registry import engine
from crosscheck.manufacture.case import CANDIDATES, held, sample_times
from crosscheck.manufacture.doubt import answers
from crosscheck.manufacture.drives import manufacture, orders
from flexmb.run.channels import signal_range
from tests.crosscheck.manufacture import scenes
from tests.repo.project import ROOT, spliced

PAGE = ROOT / "docs" / "manufactured.md"
START = "<!-- manufactured: written by python -m tests.repo.manufactured -->\n"
SCENES = {"three rigid bodies": (scenes.rigid(0), 5), "a beam and a rigid body": (scenes.scene(9), 9)}
"""Scenes and seeds of their motions."""


def engines_table() -> Iterator[str]:
    """One line for each scene and engine: the largest error of markers and of loads over their range, and over U."""
    yield "| scene | engine | error of markers | of loads | largest error over U |"
    yield "|---|---|---|---|---|"
    for title, (scene, seed) in SCENES.items():
        made, times = manufacture(scene, seed), sample_times(1.0)
        channels, known = answers(made, times)
        for name in CANDIDATES:
            code = engine(name)
            try:
                code.version()
            except EngineMissing:
                continue
            if code.supports(made.scene).kind != "exact":
                continue
            found = held(code, made.scene, times, channels, known)
            sizes = {key: signal_range(key, channels[key]) for key in found}
            shares = {key: found[key].error / sizes[key] for key in found if sizes[key] > 1e-6}
            largest = (
                max((share for key, share in shares.items() if key.startswith(kind)), default=0.0)
                for kind in ("marker:", "load:")
            )
            ratio = max(each.error / each.doubt for each in found.values())
            yield f"| {title} | `{name}` | {' | '.join(f'{x:.0e}' for x in largest)} | {ratio:.2f} |"


def orders_table() -> Iterator[str]:
    """One line for each integrator."""
    yield "| method | theory | observed | steps | errors |"
    yield "|---|---|---|---|---|"
    for each in orders(manufacture(*SCENES["three rigid bodies"])):
        steps, errors = ", ".join(map(str, each.steps)), ", ".join(f"{error:.1e}" for error in each.errors)
        yield f"| `{each.method}` | {each.theory} | {each.observed:.1f} | {steps} | {errors} |"


if __name__ == "__main__":
    lines = "".join(f"{line}\n" for line in (*engines_table(), "", *orders_table()))
    PAGE.write_text(spliced(PAGE.read_text(encoding="utf-8"), START, lines), encoding="utf-8")
