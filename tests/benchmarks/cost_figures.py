"""Figure 2 of Jain & Rodriguez, by their polynomials, by the operations that our kernels execute, and measured.

Chains of equal beams on single rotations, ruthless, as section VII has them; modes free-free, which the polynomials
assume, or clamped at the inboard hinge. Times are shown as ratios of rivals that take turns.
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
ENDS: tuple[tuple[Ends, str, str], ...] = (("free-free", "C0", "o"), ("clamped-free", "C1", "s"))
MODES = tuple(range(1, 21))
BODIES = (10, 20, 50, 100, 200, 500, 1000)
LONGEST_MEASURED = {0: 1000, 5: 200}  # by composite bodies


@cache
def chain(bodies: int, modes: int, ends: Ends) -> fm.System:
    """Rigid bodies where there are no modes."""
    return fm.compile(flexible_chain(bodies, modes, "ruthless", boundary=ends) if modes else rigid_chain(bodies))


@cache
def operations(route: str, bodies: int, modes: int, ends: Ends) -> int:
    """Executed by one evaluation, from counts of small chains: tests/flexmb/jain/test_cost.py holds the polynomials.

    Articulated bodies are linear in bodies, composite ones cubic in pairs of bodies.
    """
    if route == "articulated":
        return _continued([_counted(route, n, modes, ends) for n in (2, 3)], bodies - 2)
    return _continued([_counted(route, n, modes, ends) for n in range(2, 9, 2)], bodies // 2 - 1)


@cache
def _counted(route: str, bodies: int, modes: int, ends: Ends) -> int:
    return ROUTES[route](chain(bodies, modes, ends)).operations().total


def _continued(values: list[int], steps: int) -> int:
    """The polynomial through equidistant values, so many steps after the first: Newton's forward differences."""
    return sum(int(np.diff(values, order)[0]) * comb(steps, order) for order in range(len(values)))


def of_modes(axes: tuple[Axes, Axes]) -> None:
    """Ten bodies of 1 to 20 modes: operations of both algorithms, and the ratio of their costs."""
    left, right = axes
    paper = {route: np.array([PAPER[route]([n] * 10).total for n in MODES]) for route in ROUTES}
    for route, style in STYLES.items():
        left.semilogy(MODES, paper[route], f"k{style}", lw=1.0, label=f"{route}, paper")
    right.plot(MODES, paper["composite"] / paper["articulated"], "k-", lw=1.0, label="paper")
    for ends, colour, marker in ENDS:
        counted = {route: np.array([operations(route, 10, n, ends) for n in MODES]) for route in ROUTES}
        for route, style in STYLES.items():
            left.semilogy(MODES, counted[route], f"{colour}{style}", label=f"{route}, counted, {ends}")
        right.plot(MODES, counted["composite"] / counted["articulated"], f"{colour}-", label=f"counted, {ends}")
        times = [interleaved(*(route(chain(10, n, ends)).in_a_run for route in ROUTES.values())) for n in MODES]
        right.plot(MODES, [b / a for a, b in times], f"{colour}{marker}", ms=4, label=f"measured, {ends}")
    left.set(xlabel="modes of each body", ylabel="operations of one evaluation", xticks=MODES[::3])
    right.set(xlabel="modes of each body", ylabel="composite / articulated", xticks=MODES[::3], ylim=(0.0, None))
    left.set_title("Operations, ten bodies")
    right.set_title("How much more composite bodies cost")
    for panel in axes:
        panel.legend(fontsize=8, loc="upper left")


def of_bodies(axes: tuple[Axes, Axes]) -> None:
    """Cost per body of chains of up to 1000 bodies; unit: one articulated body in a chain of ten."""
    for panel, (modes, longest) in zip(axes, LONGEST_MEASURED.items(), strict=True):
        unit = operations("articulated", 10, modes, "clamped-free") / 10
        for colour, route in zip(("C0", "C1"), ROUTES, strict=True):
            counts = [operations(route, n, modes, "clamped-free") / n for n in BODIES]
            panel.loglog(BODIES, np.divide(counts, unit), colour, label=f"{route}, counted")
            times = [_relative_time(route, n, modes) for n in BODIES if route == "articulated" or n <= longest]
            panel.loglog(BODIES[: len(times)], times, f"{colour}o", ms=4, label=f"{route}, measured")
        panel.set(xlabel="bodies in a chain", ylabel="cost per body, articulated body of ten = 1")
        panel.set_title(f"{modes} modes each" if modes else "Rigid bodies")
        panel.legend(fontsize=8, loc="upper left")


def _relative_time(route: str, bodies: int, modes: int) -> float:
    """Time per body over that of an articulated body in a chain of ten, in turns."""
    unit, long = chain(10, modes, "clamped-free"), chain(bodies, modes, "clamped-free")
    seconds = interleaved(articulated(unit).in_a_run, ROUTES[route](long).in_a_run)
    return (seconds[1] / bodies) / (seconds[0] / 10)
