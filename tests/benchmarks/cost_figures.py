"""Figure 2 of Jain & Rodriguez, by their polynomials, by the operations that our kernels execute, and measured.

Chains of equal beams on single rotations, ruthless, as section VII has them, free-free where nothing else is said.
Times are shown as ratios of rivals that take turns.
"""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np
from matplotlib.axes import Axes

import flexmb as fm
from flexmb.jain import cost
from tests.benchmarks.rivals import Ends, flexible_chain, interleaved, rigid_chain
from tests.benchmarks.routes import articulated, composite_body

ROUTES = {"articulated": articulated, "composite": composite_body}
PAPER = {"articulated": cost.articulated, "composite": cost.composite}
STYLES = {"articulated": "-", "composite": "--"}
MODES = tuple(range(1, 21))
BODIES = (10, 20, 50, 100, 200, 500, 1000)
LONGEST_MEASURED = {0: 1000, 5: 200}  # by composite bodies


@cache
def chain(bodies: int, modes: int, ends: Ends = "free-free") -> fm.System:
    """Rigid bodies where there are no modes."""
    return fm.compile(flexible_chain(bodies, modes, "ruthless", boundary=ends) if modes else rigid_chain(bodies))


@cache
def operations(route: str, bodies: int, modes: int) -> int:
    """Executed by one evaluation: counted for 2 to 5 bodies, continued by the cubic through these counts.

    That it is a cubic is held by tests/flexmb/jain/test_cost.py.
    """
    counts = [ROUTES[route](chain(n, modes)).operations().total for n in range(2, 6)]
    return sum(int(np.diff(counts, order)[0]) * comb(bodies - 2, order) for order in range(4))


def of_modes(axes: tuple[Axes, Axes]) -> None:
    """Ten bodies of 1 to 20 modes: operations of both algorithms, and the ratio of their costs."""
    left, right = axes
    paper = {route: np.array([PAPER[route]([n] * 10).total for n in MODES]) for route in ROUTES}
    counted = {route: np.array([operations(route, 10, n) for n in MODES]) for route in ROUTES}
    for route, style in STYLES.items():
        left.semilogy(MODES, paper[route], f"k{style}", lw=1.0, label=f"{route}, paper")
        left.semilogy(MODES, counted[route], f"C0{style}", label=f"{route}, counted")
    right.plot(MODES, paper["composite"] / paper["articulated"], "k-", lw=1.0, label="paper")
    right.plot(MODES, counted["composite"] / counted["articulated"], "C0-", label="counted")
    for ends, marker in (("free-free", "o"), ("clamped-free", "s")):
        times = [interleaved(*(route(chain(10, n, ends)) for route in ROUTES.values())) for n in MODES]
        right.plot(MODES, [b / a for a, b in times], f"C1{marker}", ms=4, label=f"measured, {ends} modes")
    left.set(xlabel="modes of each body", ylabel="operations of one evaluation", xticks=MODES[::3])
    right.set(xlabel="modes of each body", ylabel="composite / articulated", xticks=MODES[::3], ylim=(0.0, None))
    left.set_title("Operations, ten bodies")
    right.set_title("How much more composite bodies cost")
    for panel in axes:
        panel.legend(fontsize=8)


def of_bodies(axes: tuple[Axes, Axes]) -> None:
    """Cost per body of chains of up to 1000 bodies; unit: one articulated body in a chain of ten."""
    for panel, (modes, longest) in zip(axes, LONGEST_MEASURED.items(), strict=True):
        unit = operations("articulated", 10, modes) / 10
        for colour, route in zip(("C0", "C1"), ROUTES, strict=True):
            counts = [operations(route, n, modes) / n for n in BODIES]
            panel.loglog(BODIES, np.divide(counts, unit), colour, label=f"{route}, counted")
            times = [_relative_time(route, n, modes) for n in BODIES if route == "articulated" or n <= longest]
            panel.loglog(BODIES[: len(times)], times, f"{colour}o", ms=4, label=f"{route}, measured")
        panel.set(xlabel="bodies in a chain", ylabel="cost per body, articulated body of ten = 1")
        panel.set_title(f"{modes} modes each" if modes else "Rigid bodies")
        panel.legend(fontsize=8)


def _relative_time(route: str, bodies: int, modes: int) -> float:
    """Time per body over that of an articulated body in a chain of ten, in turns."""
    unit, time = interleaved(articulated(chain(10, modes)), ROUTES[route](chain(bodies, modes)))
    return (time / bodies) / (unit / 10)
