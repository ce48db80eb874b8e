"""The problems of the chart: beams that bend by their length, at rest and in motion, as the cases state them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
from msgspec.structs import replace

import flexmb as fm
from flexmb.integrate.integrator import Method
from flexmb.scene import schema as s
from flexmb.scene.functions import Ramp
from flexmb.surrogate import substructured
from tests.benchmarks import exact_scenes as scenes
from tests.benchmarks.digits import elements, native, others
from tests.benchmarks.digits.problem import Ladder, Problem
from tests.benchmarks.digits.shooting import tip
from tests.benchmarks.must_hold.exact import LOAD, elastica
from tests.repo.project import ROOT

EXACT, PIECES = "exact: polynomials", "stiffened: pieces"
CABLES, ELEMENTS = "Exudyn: cable elements", "Exudyn: exact elements"  # of the former where the beam does not shear
KRATOS, RODS = "Kratos: elements", "MuJoCo: rods"
CASES = ROOT / "cases"
SMOOTH: tuple[Method, ...] = ("dop853", "radau5")
FLOWN = (0.0625 / 16.0, 0.0625 / 32.0)  # s: steps of Exudyn's 128 elements, extrapolated
OWN = "level exact with more polynomials, Radau IIA at rtol 1e-10"

Family = Callable[[], Iterator[Ladder]]


def problems() -> list[Problem]:
    """At rest first, then in motion."""
    return [
        _rolled_up(), _elastica_at_rest(), _princeton(), _bend(), _elastica(), _spun(), _spun_rods(), _pendulum(),
        _spaghetti(), _elbow(), _frame(), _crank(), _blade(), _four_bar(),
    ]  # fmt: skip


def scene_of(case: str, file: str = "scene.toml") -> fm.Scene:
    return fm.load_scene(CASES / case / file)


def over(parts: Sequence[int], ladders: Callable[[int], Iterator[Ladder]]) -> Family:
    """The ladders of every number of parts."""
    return lambda: (ladder for n in parts for ladder in ladders(n))


def moving(
    model: Callable[[int], fm.Scene], parts: Sequence[int], times: np.ndarray, methods: Sequence[Method] = SMOOTH
) -> Family:
    """Runs of a native model over its number of parts."""
    return over(parts, lambda n: native.in_motion(str(n), model(n), times, methods))


def resting(model: Callable[[int], fm.Scene], parts: Sequence[int], load: float) -> Family:
    """Equilibria of a native model over its number of parts."""
    return over(parts, lambda n: native.at_rest(str(n), model(n), load))


def cut(scene: fm.Scene, eigenmodes: int = 0, body: str | None = None) -> Callable[[int], fm.Scene]:
    """The scene with its beams, or one of them, in pieces of level stiffened."""
    return lambda n: substructured(scene, body, n, level="stiffened", eigenmodes=eigenmodes)


def curved(scene: fm.Scene) -> Callable[[int], fm.Scene]:
    """The scene with n polynomials of twist and of each curvature in each beam of level exact."""

    def model(n: int) -> fm.Scene:
        return replace(scene, bodies=tuple(_with_polynomials(body, n) for body in scene.bodies))

    return model


def _with_polynomials(body: s.Body, n: int) -> s.Body:
    if not isinstance(body, s.BeamBody) or body.level != "exact":
        return body
    strains = body.modes.polynomials
    if strains is None:
        return replace(body, modes=replace(body.modes, count=n))
    changed = {name: n for name in ("torsion", "bending_y", "bending_z") if getattr(strains, name)}
    return replace(body, modes=replace(body.modes, polynomials=replace(strains, **changed)))


def _rolled_up() -> Problem:
    """A moment of 2 pi EI/L makes a circle; one polynomial is the solution, and its points say how well it closes."""
    strip = replace(scenes.load_scene(scenes.STRIP), loads=())
    moment = s.Load(
        name="moment", body="strip", node="tip", type="torque", direction=(0.0, 0.0, 1.0), function=Ramp(rate=1.0)
    )
    scene = replace(strip, loads=(moment,))
    load = 2.0 * np.pi

    def rolled(points: int) -> fm.Scene:
        return scenes.strained(scene, s.StrainPolynomials(bending_y=1), points=points)

    return Problem(
        "roll_up", "Roll-up by 2π EI/L, at rest", 1.0, lambda: np.zeros((1, 1, 3)), "closed form",
        {
            EXACT: resting(rolled, (6, 7, 8, 9, 10, 12), load),
            PIECES: resting(cut(scene), (2, 4, 8, 16, 32), load),
            CABLES: over((4, 8, 16, 32, 64), lambda n: elements.at_rest(scene, n, load)),
        },
    )  # fmt: skip


def _elastica_at_rest() -> Problem:
    scene = scenes.at_rest_under(fm.load_scene(scenes.STRIP), 0.0, 1.0, 0.0)
    return Problem(
        "elastica_at_rest", "Elastica, P L²/EI = 10, at rest", 1.0,
        lambda: np.append(elastica(LOAD), 0.0)[None, None, :], "elliptic integrals",
        {
            EXACT: resting(partial(scenes.bending, scene), (2, 3, 4, 5, 6, 8), LOAD),
            KRATOS: over((4, 8, 16, 32, 64), lambda n: others.at_rest(scene, n, LOAD)),
            PIECES: resting(cut(scene), (2, 4, 8, 16, 32), LOAD),
            CABLES: over((4, 8, 16, 32, 64), lambda n: elements.at_rest(scene, n, LOAD)),
        },
    )  # fmt: skip


def _princeton() -> Problem:
    """Shear and stretch are the same in all three."""
    load = 8.896

    def exact(n: int) -> fm.Scene:
        curvatures = dict.fromkeys(("torsion", "bending_y", "bending_z"), n)
        others = dict.fromkeys(("axial", "shear_y", "shear_z"), max(1, n - 3))
        return scenes.princeton(s.StrainPolynomials(**curvatures, **others), 45.0, max(6, 2 * n))

    angle = np.deg2rad(45.0)
    bar = scenes.at_rest_under(fm.load_scene(scenes.PRINCETON), 0.0, float(np.cos(angle)), float(np.sin(angle)))
    (beam,) = bar.bodies
    assert isinstance(beam, s.BeamBody)
    beam = replace(beam, theory="timoshenko", modes=replace(beam.modes, families=("axial", *beam.modes.families)))
    return Problem(
        "princeton", "Princeton beam at 45°, at rest", beam.length_m,
        lambda: tip(beam, load * np.array([0.0, np.cos(angle), np.sin(angle)]))[None, None, :],
        "shooting, which level exact with 8 polynomials meets to 1e-10 m",
        {
            EXACT: resting(exact, (2, 3, 4, 5, 6), load),
            KRATOS: over((4, 8, 16, 32, 64, 128), lambda n: others.at_rest(exact(4), n, load)),
            PIECES: resting(cut(replace(bar, bodies=(beam,)), eigenmodes=4), (2, 4, 8, 16), load),
            ELEMENTS: over((4, 8, 16, 32, 64), lambda n: elements.at_rest_in_space(exact(4), n, load)),
        },
    )  # fmt: skip


def _bend() -> Problem:
    load = 600.0

    def exact(n: int) -> fm.Scene:
        return scenes.bend_45(n, max(1, n - 1))

    return Problem(
        "bend", "45-degree bend under 600, at rest", 0.25 * np.pi * scenes.RADIUS,
        native.converged_rest(scenes.bend_45(8, 6), load), "level exact with more polynomials",
        {
            EXACT: resting(exact, (2, 3, 4, 5, 6), load),
            KRATOS: over((4, 8, 16, 32, 64), lambda n: others.at_rest(exact(4), n, load)),
            ELEMENTS: over((4, 8, 16, 32, 64), lambda n: elements.at_rest_in_space(exact(4), n, load)),
        },
    )  # fmt: skip


def _elastica() -> Problem:
    scene, times = scene_of("large_deflection/elastica"), np.linspace(0.0, 4.0, 81)
    exact = partial(scenes.bending, scene)
    return Problem(
        "elastica", "Elastica in motion, 4 s", 1.0, native.converged(exact(12), times), OWN,
        {
            EXACT: moving(exact, (2, 3, 4, 5, 6, 8), times),
            PIECES: moving(cut(scene), (4, 8, 16, 32), times),
            CABLES: over((8, 16, 32, 64), lambda n: elements.in_plane(scene, n, times)),
        },
    )  # fmt: skip


def _spun() -> Problem:
    scene, times = scene_of("spinning_beam/beam_k_supercritical"), np.linspace(0.0, 8.0, 161)
    (beam,) = scene.bodies
    exact = partial(scenes.bending, scene)
    return Problem(
        "spun", "Spin-up of beam K, 8 s", beam.length_m, native.converged(exact(9), times), OWN,
        {
            EXACT: moving(exact, (2, 3, 4, 5, 6), times),
            PIECES: moving(cut(scene), (1, 2, 4, 8, 16), times),
            CABLES: over((4, 8, 16, 32), lambda n: elements.in_plane(scene, n, times)),
        },
    )  # fmt: skip


def _spun_rods() -> Problem:
    """The same beside MuJoCo's rods alone: they take a hundred times as long as all others together."""
    scene, times = scene_of("spinning_beam/beam_k_supercritical"), np.linspace(0.0, 8.0, 161)
    (beam,) = scene.bodies
    exact = partial(scenes.bending, scene)
    return Problem(
        "spun_rods", "The same beside rods", beam.length_m, native.converged(exact(9), times), OWN,
        {
            EXACT: moving(exact, (2, 3, 4, 5), times, ("radau5",)),
            RODS: over((4, 8, 16), lambda n: others.rods(scene, n, times)),
        },
    )  # fmt: skip


def _pendulum() -> Problem:
    scene, times = scene_of("large_deflection/flexible_pendulum"), np.linspace(0.0, 2.0, 101)

    def exact(n: int) -> fm.Scene:
        return scenes.strained(scene, s.StrainPolynomials(bending_y=n, axial=n // 2))

    return Problem(
        "pendulum", "Flexible pendulum, 2 s", 1.0, native.converged(exact(14), times), OWN,
        {
            EXACT: moving(exact, (4, 5, 6, 8, 10), times),
            PIECES: moving(cut(scene), (4, 8, 16), times),
            CABLES: over((8, 16, 32, 64), lambda n: elements.in_plane(scene, n, times)),
        },
    )  # fmt: skip


def _spaghetti() -> Problem:
    scene, times = scene_of("large_deflection/flying_spaghetti"), np.linspace(0.0, 2.5, 41)

    def coarse(n: int) -> fm.Scene:
        return scenes.welded(scene, n, s.StrainPolynomials(bending_y=4))

    def fine(n: int) -> fm.Scene:
        return scenes.welded(scene, n, s.StrainPolynomials(bending_y=4, axial=1, shear_y=2))

    methods: tuple[Method, ...] = ("generalised_alpha",)

    def both() -> Iterator[Ladder]:
        yield from moving(coarse, (2, 4, 8), times, (*methods, "dop853"))()
        yield from moving(fine, (4, 8, 12, 16), times, methods)()

    return Problem(
        "spaghetti", "Flying spaghetti, 2.5 s", 10.0, elements.extrapolated(scene, 128, times, FLOWN),
        "128 of Exudyn's elements, extrapolated in the step",
        {
            EXACT: both,
            PIECES: moving(cut(scene, eigenmodes=2), (8, 16, 32), times, ("dop853",)),
            ELEMENTS: over((4, 8, 16, 32, 64), lambda n: elements.in_plane(scene, n, times)),
        },
    )  # fmt: skip


def _elbow() -> Problem:
    scene, times = scene_of("frames/elbow", "exact.toml"), np.linspace(0.0, 4.0, 81)
    exact = curved(scene)
    return Problem(
        "elbow", "Elbow frame, 4 s", 10.0, native.converged(exact(7), times), OWN,
        {
            EXACT: moving(exact, (2, 3, 4, 5), times),
            PIECES: moving(cut(scene), (2, 4, 8), times),
            ELEMENTS: over((4, 8, 16, 32), lambda n: elements.in_space(scene, n, times)),
        },
    )  # fmt: skip


def _frame() -> Problem:
    scene, times = scene_of("frames/right_angle"), np.linspace(0.0, 6.0, 121)
    exact = curved(scene)
    methods: tuple[Method, ...] = ("radau5", "generalised_alpha")
    return Problem(
        "frame", "Right-angle frame, 6 s", 0.24, native.converged(exact(7), times, rtol=1e-8), OWN,
        {
            EXACT: moving(exact, (3, 4, 5), times, methods),
            PIECES: moving(cut(scene, 3), (4, 8), times, methods),
            ELEMENTS: over((4, 8, 16, 32), lambda n: elements.in_space(scene, n, times)),
        },
    )  # fmt: skip


def _crank() -> Problem:
    scene, times = scene_of("large_deflection/driven_crank", "exact.toml"), np.linspace(0.0, 0.4, 101)
    exact = curved(scene)
    return Problem(
        "crank", "Driven crank, 0.4 s", 1.0, native.converged(exact(9), times, rtol=1e-6),
        "level exact with more polynomials, Radau IIA at rtol 1e-6",
        {
            EXACT: moving(exact, (3, 4, 5, 6), times),
            PIECES: moving(cut(scene, 2, "beam"), (2, 4, 8), times),
            ELEMENTS: over((4, 8, 16, 32), lambda n: elements.in_space(scene, n, times)),
        },
    )  # fmt: skip


def _blade() -> Problem:
    scene, times = scene_of("beams/coned_blade", "untwisted.toml"), np.linspace(0.0, 3.0, 151)
    exact = curved(scene)
    return Problem(
        "blade", "Coned blade, spun up, 3 s", 5.0, native.converged(exact(9), times), OWN,
        {
            EXACT: moving(exact, (3, 4, 5, 6), times),
            PIECES: moving(cut(scene), (2, 4, 8), times),
            ELEMENTS: over((4, 8, 16, 32), lambda n: elements.in_space(scene, n, times)),
        },
    )  # fmt: skip


def _four_bar() -> Problem:
    scene, times = scene_of("flexible_mechanisms/misaligned_four_bar", "exact.toml"), np.linspace(0.0, 4.0, 201)
    pieces = scene_of("flexible_mechanisms/misaligned_four_bar")
    exact = curved(scene)
    implicit: tuple[Method, ...] = ("radau5",)
    return Problem(
        "four_bar", "Misaligned four-bar, 4 s", 0.24, native.converged(exact(6), times, rtol=1e-8), OWN,
        {
            EXACT: moving(exact, (1, 2, 3, 4), times, implicit),
            PIECES: moving(cut(pieces), (1, 2, 4), times, implicit),
        },
    )  # fmt: skip
