"""The ground that shakes: models by its acceleration, effective masses, random responses; against closed forms, against
`linearize` of the same scene on a ground at rest, and against runs on a ground that moves."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from typer.testing import CliRunner

import flexmb as fm
from flexmb.cli import app
from flexmb.linear import base_excitation as rooms
from flexmb.linear import random_response
from flexmb.scene.build import SceneBuilder
from flexmb.scene.files import load_scene
from flexmb.scene.shapes import beam_section
from tests.bounds import UNIT_ROUNDOFF

ROUNDING = 2.0**12 * UNIT_ROUNDOFF
MASS, HZ, ZETA = 2.0, 50.0, 0.05
OMEGA = 2.0 * np.pi * HZ
WHITE = [(1e-8, 3.0), (1e10, 3.0)]
"""A white density, (m/s^2)^2/Hz; what lies outside is 1e-9 of the closed forms."""
UPRIGHT = (0.5**0.5, 0.0, -(0.5**0.5), 0.0)


def oscillator(builder: SceneBuilder, parent: str = "ground", damping: float = 2.0 * ZETA * OMEGA * MASS) -> fm.Scene:
    return (
        builder.rigid_body("mass", mass=MASS, inertia=(0.1, 0.1, 0.1))
        .prismatic("spring", parent, "mass", axis=(0, 0, 1), stiffness=MASS * OMEGA**2, damping=damping)
        .marker("top", "mass")
        .scene()
    )


def mast(level: str = "full", count: int = 12) -> fm.SceneBuilder:
    section = beam_section(E=7e10, G=2.7e10, A=1e-3, Iy=2e-7, Iz=1e-7, rho=2700.0)
    modes = fm.Modes(count=count, families=("bending_y", "bending_z"), damping_ratio=0.02)
    return (
        fm.SceneBuilder("mast", gravity=(0.0, 0.0, -9.81))
        .beam("mast", length=2.0, elements=12, section=section, modes=modes, level=level)
        .marker("eye", "mast", node="tip")
    )


def standing(**given) -> fm.Scene:
    return mast(**given).weld("root", "ground", "mast", parent_quaternion=UPRIGHT).scene()


def test_an_oscillator_under_white_noise():
    """Miles: the absolute acceleration pi/2 f Q S (1 + 4 zeta^2), the stroke S / (64 pi^3 zeta f^3), exactly."""
    model = fm.base_excitation(oscillator(fm.SceneBuilder("o", gravity=(0, 0, -9.81)))).model
    found = fm.random_response(model, {"base.z": WHITE}, ("top.acceleration.z", "top.z", "load:spring.force.z"))
    acceleration = np.pi / 2.0 * HZ / (2.0 * ZETA) * WHITE[0][1] * (1.0 + 4.0 * ZETA**2)
    stroke = WHITE[0][1] / (64.0 * np.pi**3 * ZETA * HZ**3)
    np.testing.assert_allclose(found.rms**2, [acceleration, stroke, MASS**2 * acceleration], rtol=1e-8)
    assert np.all(found.error <= 1e-8 * found.rms)
    assert found.crossings_hz[1] == pytest.approx(HZ, rel=1e-4)  # the velocity's mean square over the stroke's


def test_a_colour_between_points_is_integrated_as_drawn():
    model = fm.base_excitation(oscillator(fm.SceneBuilder("o"))).model
    density = fm.SpectralDensity.in_g([(20.0, 0.01), (80.0, 0.04), (350.0, 0.04), (2000.0, 0.007)])
    found = fm.random_response(model, {"base.z": density}, ("top.z",))

    def of(f: float) -> float:
        omega = 2.0 * np.pi * f
        return float(density.at(f)) / ((OMEGA**2 - omega**2) ** 2 + (2.0 * ZETA * OMEGA * omega) ** 2)

    nodes, weights = np.polynomial.legendre.leggauss(20)
    ends = np.concatenate([np.linspace(20, 80, 121)[:-1], np.linspace(80, 350, 121)[:-1], np.linspace(350, 2000, 121)])
    middle, half = 0.5 * (ends[1:] + ends[:-1]), 0.5 * np.diff(ends)
    whole = sum(
        h * w * of(m + h * x) for m, h in zip(middle, half, strict=True) for x, w in zip(nodes, weights, strict=True)
    )
    assert found["top.z"] == pytest.approx(np.sqrt(whole), rel=1e-8)
    np.testing.assert_allclose(found.density([10.0, 50.0, 3000.0])[:, 0], [0.0, of(50.0), 0.0], rtol=1e-10)
    inside = quad(lambda f: float(density.at(f)), 20, 2000, points=[80, 350], epsrel=1e-12)[0]
    assert density.rms == pytest.approx(np.sqrt(inside), rel=1e-10)


def test_inputs_that_are_not_correlated_add_their_squares():
    model = fm.base_excitation(standing()).model
    names, x, y = ("load:root.torque.x", "load:root.torque.y"), {"base.x": WHITE}, {"base.y": WHITE}
    alone = [fm.random_response(model, density, names).rms for density in (x, y)]
    np.testing.assert_allclose(fm.random_response(model, x | y, names).rms, np.hypot(*alone), rtol=1e-8)


LIBRARY = [
    "pendulums/double", "chains/mass_ratio", "beams/tip_mass", "connectors/sprung_platform", "sliders/crane",
    "closed_chains/four_bar", "closed_chains/flexible_four_bar", "wheel_gyrostat/flexible_appendage",
    "closed_chains/four_bar/pins.toml",
]  # fmt: skip


@pytest.mark.parametrize("case", LIBRARY)
def test_on_a_ground_at_rest_it_is_the_linear_model(case: str):
    """Whatever hangs on the ground, at a state that is no equilibrium: stiffness by gravity and loads among it."""
    system = fm.compile(load_scene(f"cases/{case}" if case.endswith(".toml") else f"cases/{case}/scene.toml"))
    rest, shaken = fm.linearize(system), fm.base_excitation(system).model
    assert shaken.states == rest.states
    own = [[name for name, _ in shaken.outputs].index(name) for name, _ in rest.outputs]
    for name, left, right in [
        ("A", rest.A, shaken.A), ("B", rest.B, shaken.B[:, 3:]), ("C", rest.C, shaken.C[own]),
        ("D", rest.D, shaken.D[own, 3:]), ("mass", rest.mass, shaken.mass), ("motion", rest.motion, shaken.motion),
        ("rates", rest.rates[:, None], shaken.rates[:, None]),
    ]:  # fmt: skip
        close(name, left, right)
    close("drift", np.r_[rest.drift, np.abs(rest.A).max()], np.r_[shaken.drift, np.abs(rest.A).max()])


def close(name: str, left, right, bound: float = 1e-11) -> None:
    size = np.max(np.abs(left), initial=0.0)
    assert np.max(np.abs(left - right), initial=0.0) <= bound * size, name


def test_a_base_that_falls_would_have_no_stiffness_by_gravity(monkeypatch):
    """The test above notices where the loads that hold the base are left out."""
    system = fm.compile(load_scene("cases/pendulums/compound/scene.toml"))
    monkeypatch.setattr(rooms, "_holding", lambda base, falling: [])
    rest, shaken = fm.linearize(system), fm.base_excitation(system).model
    with pytest.raises(AssertionError):
        close("A", rest.A, shaken.A, 0.1)


def test_continuous_controllers_shake_along():
    scene = (
        fm.SceneBuilder("held", gravity=(0.0, 0.0, -9.81))
        .rigid_body("arm", mass=1.0, com=(0.3, 0.0, 0.0), inertia=(0.01, 0.01, 0.01))
        .revolute("pivot", "ground", "arm", axis=(0, 1, 0), torque=fm.ControlSignal(source="hold"))
        .marker("end", "arm", offset=(0.5, 0.0, 0.0))
        .sense_coordinate("angle", "pivot")
        .pid("hold", "angle", kp=80.0, ki=60.0, kd=4.0, filter=1e-3)
        .scene()
    )  # fmt: skip
    system = fm.compile(scene)
    rest, found = fm.linearize(system), fm.base_excitation(system)
    close("A", rest.A, found.model.A)
    # slow shaking leaves the arm where it is: the whole is shaken as rigid, by the integrator
    slow = found.model.frequency_response("base.z", [1e-4], ("base.force.z", "end.acceleration.z"))
    np.testing.assert_allclose(slow[0], [1.0, 1.0], rtol=1e-6)
    with pytest.raises(NotImplementedError, match="open_loop"):
        found.modes  # noqa: B018


def test_effective_masses_of_a_cantilever():
    """61.3, 18.8 and 6.5 % of a uniform beam in its first bending modes."""
    section = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=2e-9, Iz=1e-9, rho=2700.0)
    modes = fm.Modes(count=8, families=("bending_y",))
    scene = (
        fm.SceneBuilder("clamped")
        .beam("beam", length=2.0, elements=60, section=section, modes=modes)
        .weld("root", "ground", "beam")
        .scene()
    )
    found = fm.base_excitation(scene).modes
    shares = found.shares[:, 1]
    np.testing.assert_allclose(shares[:4], [0.61307, 0.18830, 0.06474, 0.03306], rtol=2e-3)
    assert found.total[1] == pytest.approx(2700.0 * 1e-4 * 2.0, rel=1e-12)
    np.testing.assert_allclose(found.shares[:, [0, 2]], 0.0, atol=1e-12)


def test_effective_masses_add_up():
    excitation = fm.base_excitation(standing())
    found, L = excitation.modes, excitation.coupling
    every = np.diag(L.T @ np.linalg.solve(excitation.model.mass, L))[[3, 4, 5, 0, 1, 2]]
    np.testing.assert_allclose(np.sum(found.effective_masses, axis=0), every, rtol=1e-9, atol=1e-12 * every.max())
    about_tip = found.factors_about((0.0, 0.0, 2.0))
    # about the tip: the moment of the first mode about it, by the shift of the axis
    np.testing.assert_allclose(about_tip[:, 4], found.factors[:, 4] - 2.0 * found.factors[:, 0], atol=1e-12)
    chain = fm.base_excitation(oscillator(fm.SceneBuilder("o")))
    np.testing.assert_allclose(chain.modes.effective_masses, [[0.0, 0.0, MASS, 0.0, 0.0, 0.0]], atol=ROUNDING)
    assert chain.modes.frequencies_hz[0] == pytest.approx(HZ, rel=ROUNDING)
    assert chain.modes.damping_ratios[0] == pytest.approx(ZETA, rel=ROUNDING)


def test_slow_shaking_moves_all_of_the_mass():
    for scene in (standing(), load_scene("cases/connectors/beam_on_bushing/scene.toml")):
        system = fm.compile(scene)
        excitation = fm.base_excitation(system, fm.equilibrium(system), held=True)
        mass = excitation.rigid[3, 3]
        names = ("base.force.x", "base.force.y", "base.force.z")
        slow = np.array([excitation.model.frequency_response(f"base.{axis}", [1e-3], names)[0] for axis in "xyz"])
        np.testing.assert_allclose(slow, mass * np.eye(3), atol=1e-5 * mass)


def shaking(motion: fm.Function) -> fm.SceneBuilder:
    """The mast on a table that a motion along x drives."""
    return (
        mast(count=4)
        .rigid_body("table", mass=50.0, inertia=(1.0, 1.0, 1.0))
        .prismatic("shaker", "ground", "table", axis=(1, 0, 0), prescribed=motion)
        .weld("root", "table", "mast", parent_quaternion=UPRIGHT)
    )


def test_runs_on_a_ground_that_moves():
    """A periodic motion of many frequencies with random phases: the mean squares of a run over one period, after what
    was there at the start has died away, are the sums over |H|^2, and nearly the integral of a dense density."""
    period, low, high, settled = 4.0, 2.0, 30.0, 24.0
    f = np.arange(low, high, 1.0 / period)
    density = fm.SpectralDensity.of([(low, 4e-4), (high, 1e-3)])
    amplitude = np.sqrt(2.0 * density.at(f) / period)
    phase = np.random.default_rng(3).uniform(0.0, 2.0 * np.pi, len(f))
    t = np.arange(0.0, settled + period + 0.01, 0.004)
    omega = 2.0 * np.pi * f
    x = -(amplitude / omega**2) @ np.cos(omega[:, None] * t + phase[:, None])
    motion = fm.Table(times_s=tuple(t.tolist()), values=tuple(x.tolist()))
    run = fm.simulate(
        shaking(motion).scene(), settled + period, samples=int(round((settled + period) * 250)) + 1, rtol=1e-8
    )
    last = slice(-int(round(period * 250)) - 1, -1)
    load, eye = run.loads["root"][last], run.markers["eye"].acceleration[last]
    measured = [np.std(load[:, 3]), np.std(load[:, 1]), np.std(eye[:, 3])]

    model = fm.base_excitation(standing(count=4)).model
    names = ("load:root.force.x", "load:root.torque.y", "eye.acceleration.x")
    response = model.frequency_response("base.x", omega, names)
    lines = np.sqrt(np.sum(0.5 * np.abs(response) ** 2 * amplitude[:, None] ** 2, axis=0))
    np.testing.assert_allclose(measured, lines, rtol=2e-3)
    integral = fm.random_response(model, {"base.x": density}, names).rms
    np.testing.assert_allclose(integral, lines, rtol=0.15)  # lines a quarter of a Hz apart, resonances as wide


REFUSED = [
    ("undamped", lambda: oscillator(fm.SceneBuilder("o"), damping=0.0), ValueError, "no damping"),
    ("unstable", lambda: load_scene("cases/tops/sleeping/scene.toml"), ValueError, "stationary|no damping"),
]


@pytest.mark.parametrize(("_", "scene", "error", "word"), REFUSED)
def test_what_is_not_stationary_is_refused(_, scene, error, word):
    model = fm.base_excitation(scene()).model
    with pytest.raises(error, match=word):
        fm.random_response(model, {"base.z": WHITE})
    with pytest.raises(KeyError, match=r"base\.x"):
        fm.random_response(model, {"nothing": WHITE})


def test_what_turns_has_no_real_modes():
    with pytest.raises(ValueError, match="no real modes"):
        fm.base_excitation(load_scene("cases/tops/lagrange/scene.toml")).modes  # noqa: B018


@pytest.mark.parametrize(
    ("points", "word"),
    [
        ([(1.0, 1.0)], "two points"), ([(0.0, 1.0), (1.0, 1.0)], "positive"), ([(2.0, 1.0), (1.0, 1.0)], "ascend"),
        ([(1.0, 0.0), (2.0, 1.0)], "values"), ([1.0, 2.0], "pairs"), ([(1.0, np.nan), (2.0, 1.0)], "finite"),
    ],
)  # fmt: skip
def test_densities_that_are_none(points, word):
    with pytest.raises(ValueError, match=word):
        fm.SpectralDensity.of(points)


def test_the_command(tmp_path):
    path = tmp_path / "mast.toml"
    fm.save_scene(standing(), path)
    command = ["vibrate", str(path)]
    modes = CliRunner().invoke(app, command)
    assert modes.exit_code == 0 and "Effective masses of mast" in modes.output and "mast.mode[0]" in modes.output
    picture, csv = tmp_path / "a.png", tmp_path / "a.csv"
    more = [
        "--axis",
        "x",
        "--density",
        "20:0.01,2000:0.01",
        "--output",
        "load:root.force.?",
        "-o",
        picture,
        "--csv",
        csv,
    ]
    found = CliRunner().invoke(app, [*command, *map(str, more)])
    assert found.exit_code == 0, found.output
    assert "load:root.force.x" in found.output and "load:root.force.y" not in found.output  # it does not move
    assert picture.stat().st_size > 10_000
    table = np.genfromtxt(csv, delimiter=",", skip_header=1)
    assert table.shape[1] == 4 and np.all(np.isfinite(table))
    for wrong in (["--density", "20"], ["--unit", "mm", "--density", "1:1,2:1"], ["--axis", "w"], ["--at", "rest"]):
        assert CliRunner().invoke(app, [*command, *wrong]).exit_code == 2


def test_integrals_that_are_not_known_are_refused(monkeypatch):
    monkeypatch.setattr(random_response, "MOST_INTERVALS", 1)
    monkeypatch.setattr(random_response, "resonances", lambda model, low, high: np.zeros(0))
    model = fm.base_excitation(standing()).model
    with pytest.raises(ArithmeticError, match="narrow the band"):
        fm.random_response(model, {"base.x": [(1.0, 1.0), (1e4, 1.0)]}, ("load:root.force.x",))
