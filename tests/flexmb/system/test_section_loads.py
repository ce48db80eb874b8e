"""Loads across a beam's sections: the hinge's load at the root, nothing at a free end, statics, and closed forms."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter
from typing import Any

import numpy as np
import pytest

import flexmb as fm
from flexmb.modal.strain_field import StrainField
from flexmb.scene.sections import transport
from flexmb.scene.shapes import beam_section
from flexmb.system.frames import hinge_frames, node_pose
from flexmb.system.moved_sections import moved_sections, turning
from tests.bounds import UNIT_ROUNDOFF
from tests.flexmb.modal.coupled_references import coupled_stiffness, section_mass, station

ROUNDING = 2.0**12 * UNIT_ROUNDOFF
LENGTH, E, RHO, AREA, IZ = 2.0, 7e10, 2700.0, 2e-4, 3e-9
SECTION = beam_section(E=E, G=2.7e10, A=AREA, Iy=2e-9, Iz=IZ, rho=RHO)


def everything(closed: bool = False, connected: bool = False, node: str = "origin", **beam: Any) -> fm.Scene:
    """A beam with all that can act on one: tip mass, outboard body, wheel, slosh mass, loads, a closure, connectors."""
    section = beam.pop("section", SECTION)
    lump = fm.TipMass(x_m=1.3, mass_kg=0.4, com_m=(0.0, 0.05, 0.02),
                      inertia_kg_m2=((2e-3, 0.0, 0.0), (0.0, 1e-3, 0.0), (0.0, 0.0, 1.5e-3)))  # fmt: skip
    modes = beam.pop("modes", fm.Modes(count=5, static=True))
    builder = (
        fm.SceneBuilder("everything", gravity=(0.3, -9.81, 1.0), allow=("uncut_beam",))
        .rigid_body("hub", mass=3.0, inertia=(1.0, 1.0, 1.0))
        .beam("beam", length=LENGTH, elements=4, section=section, modes=modes, nodes={"middle": 0.7},
              tip_masses=[lump], **beam)
        .rigid_body("hand", mass=0.5, inertia=(1e-3, 2e-3, 2e-3), com=(0.1, 0.0, 0.0))
        .free("base", "ground", "hub")
        .revolute("root", "hub", "beam", axis=(0.6, 0.0, 0.8), parent_position=(0.2, 0.1, 0.0), child_node=node,
                  child_position=(0.03, 0.0, 0.02), child_quaternion=(np.cos(0.2), 0.0, np.sin(0.2), 0.0))
        .universal("wrist", "beam", "hand", parent_node="tip")
        .wheel("wheel", "beam", node="middle", axis=(0.0, 0.6, 0.8), mass=0.2, axial_inertia=1e-3,
               transverse_inertia=6e-4, speed=100.0, offset=(0.0, 0.1, 0.0))
        .point_mass("slosh", "beam", node="middle", mass=0.1, directions=[(0, 1, 0)])
        .force("push", "beam", node="middle", direction=(0, 0, 1), function=fm.Constant(value=2.0), frame="node")
        .torque("twist", "beam", node="tip", direction=(1, 0, 0), function=fm.Constant(value=0.3))
    )  # fmt: skip
    if closed:
        builder.rigid_body("strut", mass=0.2, inertia=(1e-3, 1e-3, 1e-3))
        builder.spherical("ball", "hub", "strut", parent_position=(0.0, 1.0, 0.0))
        builder.closure("end", "spherical", "strut", "beam", node_b="middle", position_a=(0.9, 0.0, 0.0))
    if connected:
        stiff = tuple(tuple(30.0 * (i == j) for j in range(6)) for i in range(6))
        builder.spring_damper("cable", "beam", "hub", node_a="middle", position_a=(0.1, 0.2, 0.0), stiffness=50.0,
                              damping=3.0, free_length=0.3)  # fmt: skip
        builder.bushing("mount", "ground", "beam", node_b="tip", position_b=(0.0, 0.1, 0.0), stiffness=stiff)
    return builder.scene()


def somewhere(system: fm.System, size: float = 3e-3) -> fm.State:
    """Bent and moving; a closed chain where it starts."""
    state, random = system.initial_state, np.random.default_rng(0)
    if not system.scene.closures:
        state.q[7:] += size * random.normal(size=system.nq - 7)
        state.u[:] = random.normal(size=system.nu)
    return state


def at_root(system: fm.System, state: fm.State, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The load across the section at x = 0, and that across the hinge, both World about the hinge's point."""
    w = system.all_loads(state).motion
    root, point = node_pose(system, w, "beam", "root"), hinge_frames(system, w)["root"].point
    torque, force = root.rotation @ load[:3], root.rotation @ load[3:]
    about = torque + np.cross(root.position - point, force)
    return np.concatenate([about, force]), system.hinge_loads(state)["root"]


COUPLED = station(0.0, 1e-3 * coupled_stiffness(), 0.2 * section_mass(), (0.01, 0.02))
BLADE: Mapping[str, Any] = {"section": COUPLED, "theory": "timoshenko"}
VARIANTS: Mapping[str, dict[str, Any]] = {
    "full": {}, "line": {"points": "line"}, "rotary": {"points": "rotary"}, "lumped": {"mass": "lumped"},
    "rigid": {"level": "rigid"}, "ruthless": {"level": "ruthless"}, "closed": {"closed": True},
    "connected": {"connected": True},
    "timoshenko": {"theory": "timoshenko"}, "coupled": BLADE, "coupled rotary": {"points": "rotary", **BLADE},
    "coupled line": {"points": "line", **BLADE},
    "exact": {"level": "exact"}, "exact, closed": {"level": "exact", "closed": True},
    "exact, in pieces": {"level": "exact", "modes": fm.Modes(count=2, pieces=3)},
}  # fmt: skip


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.filterwarnings("ignore:.*has its mass lumped")
def test_the_root_transmits_what_the_hinge_does(variant: str) -> None:
    """To rounding; rotating tensors are no polynomials, and the cuts refine their integrals: to quadrature."""
    system = fm.compile(everything(**VARIANTS[variant]))
    state = somewhere(system)
    # turning mass centres off the axis are farther from polynomials yet, and are summed over the points of the motion
    cuts = [0.0] if variant == "coupled rotary" else [0.0, 0.5, 0.7, 1.3, 2.0]
    found = system.section_loads(state, "beam", cuts)
    section, hinge = at_root(system, state, found.load[0])
    allowed = 1e-10 if variant == "rotary" else 64 * ROUNDING
    cancelling = what_cancels(system, state) if "exact" in variant else 0.0
    for part in (slice(0, 3), slice(3, 6)):
        assert np.linalg.norm(section[part] - hinge[part]) < allowed * (np.linalg.norm(hinge[part]) + cancelling)


def what_cancels(system: fm.System, state: fm.State) -> float:
    """Size of the inertia forces of single strain modes: the fast ones accelerate by far more than the beam does."""
    model = next(link.model for link in system.links if link.name == "beam")
    rates = np.abs(system.accelerations(state)[system.speed("beam.modes")])
    return float(model.mass @ np.linalg.norm(np.abs(model.translation) @ rates, axis=1))


def test_levels_that_are_cut_off_are_off_by_what_they_neglect() -> None:
    """linear by the second order of the deformation; stiffened, whose masses are equivalent ones, by the fourth."""
    for level, order in (("linear", 2), ("stiffened", 3)):
        errors = []
        for size in (4e-4, 2e-4):
            system = fm.compile(everything(level=level))
            state = somewhere(system, size)
            state.u[7:] = 0.0
            section, hinge = at_root(system, state, system.section_loads(state, "beam", [0.0]).load[0])
            errors.append(np.linalg.norm(section - hinge))
        assert errors[1] < 1.2 * errors[0] / 2.0**order + 1e-11 * np.linalg.norm(hinge)


@pytest.mark.parametrize("node", ["middle", "tip"])
@pytest.mark.parametrize("boundary", ["clamped-free", "free-free"])
def test_a_free_root_transmits_nothing(node: str, boundary: str) -> None:
    """The beam hangs on another node: beyond x = 0 is all of it, hinge included."""
    modes = fm.Modes(count=5, boundary=boundary)  # type: ignore[arg-type]
    transmits_nothing(everything(node=node, modes=modes))


@pytest.mark.parametrize("node", ["middle", "tip"])
def test_a_free_root_of_strains_transmits_nothing(node: str) -> None:
    """Likewise at level exact."""
    transmits_nothing(everything(node=node, level="exact", modes=fm.Modes(count=3)))


def transmits_nothing(scene: fm.Scene) -> None:
    """The free root of a bent beam that moves."""
    system = fm.compile(scene)
    found = system.section_loads(somewhere(system), "beam", [0.0, 0.3, 0.7, 1.99])
    assert np.max(np.abs(found.load[0])) < 64 * ROUNDING * np.max(np.abs(found.load))


def test_statics_of_a_beam_bent_by_its_length() -> None:
    """A tip force and the weight of a curved beam of level exact, bent by more than a radian: its moment across any
    section is that of the force and of the weight beyond, about the deformed section; the beam bends by moment / EI."""
    soft = [fm.BeamStation(x_m=x, EA_N=1e3, EIy_Nm2=1.0, EIz_Nm2=1.0, GJ_Nm2=1.0, mass_per_length_kg_m=0.5,
                           rotary_y_kg_m=1e-3, rotary_z_kg_m=1e-3, curvature_1_m=(0.0, 0.0, 0.4)) for x in (0.0, 1.0)]
    x = np.array([0.0, 0.25, 0.6])
    scene = (
        fm.SceneBuilder("cantilever", gravity=(0.0, -9.81, 0.0), allow=("wave_speed", "held_stretch"))
        .beam("beam", length=1.0, elements=6, section=soft, level="exact", nodes={"a": 0.25, "b": 0.6},
              modes=fm.Modes(count=12, families=("bending_y",)))
        .weld("clamp", "ground", "beam")
        .force("pull", "beam", node="tip", direction=(0.0, 1.0, 0.0), function=fm.Constant(value=9.0))
        .marker("a", "beam", node="a").marker("b", "beam", node="b").marker("tip", "beam", node="tip")
        .marker("root", "beam").scene()
    )  # fmt: skip
    system = fm.compile(scene)
    rest = fm.equilibrium(system)
    found = system.section_loads(rest, "beam", x)
    seen = system.evaluate(0.0, rest.q, rest.u).markers
    assert np.arctan2(*seen["tip"].rotation[[1, 0], 0]) > 1.0
    field = system.links[0].model.field
    moved = moved_sections(field, rest.q, 0.0 * rest.q, 0.0 * rest.q)
    points, weight = moved.r[field.gauss], np.polynomial.legendre.leggauss(len(field.gauss))[1] / 2.0
    for i, name in enumerate(("root", "a", "b")):
        R, at = seen[name].rotation, seen[name].position
        curvature = 0.4 + field_curvature(field, rest.q, x[i])
        assert found.bending[i, 1] == pytest.approx(curvature - 0.4, abs=1e-6)
        inward = R.T @ [0.0, 9.0 - 0.5 * 9.81 * (1.0 - x[i]), 0.0]
        np.testing.assert_allclose([found.axial[i], *found.shear[i]], inward, atol=1e-10)
        if name == "root":
            weigh = np.cross(points - at, [0.0, -0.5 * 9.81, 0.0]).T @ weight
            moment = R.T @ (np.cross(seen["tip"].position - at, [0.0, 9.0, 0.0]) + weigh)
            np.testing.assert_allclose([found.torsion[i], *found.bending[i]], moment, atol=1e-10)


def field_curvature(field: StrainField, eta: np.ndarray, x: float) -> float:
    """The elastic curvature about z at x: the slope of the polynomial that the turn of the sections is."""
    turn, _ = field.shapes()
    angle = np.polynomial.legendre.Legendre.fit(field.x, turn[:, 2] @ eta, field.mode_count, domain=[0.0, 1.0])
    return float(angle.deriv()(x))


def test_a_cut_through_a_rigid_beam_is_a_weld() -> None:
    """Two rigid beams welded where the one is cut: the weld's load, in the beams' axes, about the same point."""

    def scene(pieces: tuple[float, ...]) -> fm.Scene:
        builder = fm.SceneBuilder("cut", gravity=(0.0, -9.81, 0.0))
        for i, length in enumerate(pieces):
            builder.beam(f"piece {i}", length=length, elements=2, section=SECTION, modes=1, level="rigid")
        builder.spherical("root", "ground", "piece 0", angular_velocity=(0.4, -2.0, 3.0))
        if len(pieces) > 1:
            builder.weld("cut", "piece 0", "piece 1", parent_node="tip")
        return builder.scene()

    whole, cut = fm.compile(scene((2.0,))), fm.compile(scene((0.7, 1.3)))
    found = whole.section_loads(whole.initial_state, "piece 0", 0.7)
    expected = cut.hinge_loads(cut.initial_state, axes="outboard")["cut"]
    np.testing.assert_allclose(found.load[0], expected, atol=ROUNDING * np.linalg.norm(expected))


@pytest.mark.parametrize("count", [1, 3])
def test_statics_are_exact_with_any_number_of_modes(count: int) -> None:
    """A tip force: the same force across every section, its moment about the deformed section; modes' curvature is not.

    Two modes off, the deflection is wrong by a few per cent, the loads by rounding.
    """
    modes = fm.Modes(count=count, families=("bending_y", "axial"))
    scene = (
        fm.SceneBuilder("cantilever")
        .beam("beam", length=LENGTH, elements=6, section=SECTION, modes=modes, nodes={"a": 0.5, "b": 1.25})
        .weld("clamp", "ground", "beam")
        .force("pull", "beam", node="tip", direction=(0.6, -0.8, 0.0), function=fm.Constant(value=5.0))
        .marker("a", "beam", node="a").marker("b", "beam", node="b").marker("tip", "beam", node="tip")
        .scene()
    )  # fmt: skip
    system = fm.compile(scene)
    rest = fm.equilibrium(system)
    found = system.section_loads(rest, "beam", [0.5, 1.25])
    seen = system.evaluate(0.0, rest.q, rest.u).markers
    force = 5.0 * np.array([0.6, -0.8, 0.0])
    for i, name in enumerate("ab"):
        R = seen[name].rotation
        moment = R.T @ np.cross(seen["tip"].position - seen[name].position, force)
        inward = R.T @ force
        np.testing.assert_allclose([found.axial[i], *found.shear[i]], inward, atol=1e-8)  # as well as it is at rest
        np.testing.assert_allclose([found.torsion[i], *found.bending[i]], moment, atol=1e-8)


def test_stresses_of_a_bent_pulled_and_twisted_beam() -> None:
    """sigma = N/A + M c/I: the side toward which the force lifts the tip is compressed; and T r / J."""
    pull, lift, twist, c = 0.1, 1e-3, 2e-3, 0.01
    scene = (
        fm.SceneBuilder("cantilever")
        .beam("beam", length=LENGTH, elements=4, section=SECTION, modes=fm.Modes(count=0, static=True))
        .weld("clamp", "ground", "beam")
        .force("pull", "beam", node="tip", direction=(1, 0, 0), function=fm.Constant(value=pull))
        .force("lift", "beam", node="tip", direction=(0, 1, 0), function=fm.Constant(value=lift))
        .torque("twist", "beam", node="tip", direction=(1, 0, 0), function=fm.Constant(value=twist))
        .scene()
    )
    system = fm.compile(scene)
    found = system.section_loads(fm.equilibrium(system), "beam", [0.0, 1.0])
    bent = 2e-3  # what the deflection changes: it takes pull * deflection from lift * arm
    moment = lift * np.array([2.0, 1.0])
    for y, sign in ((0.0, 0.0), (c, -1.0), (-c, 1.0)):
        expected = pull / AREA + sign * moment * c / IZ
        np.testing.assert_allclose(found.normal_stress(E, y=y, z=0.0), expected, rtol=bent)
    GJ = scene.bodies[0].stations[0].GJ_Nm2
    np.testing.assert_allclose(found.torsion_stress(2.7e10, 0.02), 2.7e10 * 0.02 * twist / GJ, rtol=bent)


@pytest.mark.parametrize("theory", ["timoshenko", "euler-bernoulli"])
def test_strains_and_stresses_of_a_coupled_section(theory: Any) -> None:
    """A tip load on a uniform cantilever: compliance times the load of the section, and the strain of a fibre."""
    laminate = {(0, 3): 0.1, (0, 4): -0.1, (0, 5): 0.15, (3, 4): 0.3, (3, 5): -0.2, (4, 5): 0.25}
    K = coupled_stiffness(laminate)
    force, torque = np.array([2e-2, 3e-4, -2e-4]), np.array([4e-4, 1e-4, 2e-4])
    x, point = np.array([0.0, 0.7]), (0.01, 0.02) if theory == "timoshenko" else (0.0, 0.0)
    builder = fm.SceneBuilder("cantilever").beam(
        "beam", length=LENGTH, elements=4, section=station(0.0, K, section_mass(), point), theory=theory,
        modes=fm.Modes(count=0, static=True),
    ).weld("clamp", "ground", "beam")  # fmt: skip
    for i, direction in enumerate(np.eye(3).tolist()):
        builder.force(f"f{i}", "beam", node="tip", direction=direction, function=fm.Constant(value=force[i]))
        builder.torque(f"t{i}", "beam", node="tip", direction=direction, function=fm.Constant(value=torque[i]))
    system = fm.compile(builder.scene())
    found = system.section_loads(fm.equilibrium(system), "beam", x)
    T = transport(point)
    S = np.linalg.inv(T.T @ K @ T)
    if theory == "euler-bernoulli":
        S[1:3] = S[:, 1:3] = 0.0
    arms = (LENGTH - x)[:, None] * [1.0, 0.0, 0.0]
    loads = np.hstack([np.tile(force, (2, 1)), torque + np.cross(arms, force)])
    expected = loads @ S
    bent = 1e-5 * np.max(np.abs(expected))  # what the deflection of a tenth of a micrometre turns and shifts
    np.testing.assert_allclose(found.strain, expected, atol=bent)
    fibre = expected[:, 0] + 0.01 * expected[:, 4] - 0.03 * expected[:, 5]
    np.testing.assert_allclose(found.normal_stress(E, y=0.03, z=0.01), E * fibre, atol=E * bent)
    sheared = found.torsion_stress(2.7e10, 0.02)
    np.testing.assert_allclose(sheared, 2.7e10 * 0.02 * expected[:, 3], atol=2.7e10 * 0.02 * bent)


def strip(width: float, x: float, height: float = 0.005) -> fm.BeamStation:
    area = width * height
    return beam_section(E=E, G=2.7e10, A=area, Iy=area * width**2 / 12, Iz=area * height**2 / 12, rho=RHO, x=x)


def test_a_tapered_beam_with_a_load_at_its_tip_and_with_a_mass_there_that_spins() -> None:
    """Deflection: the integral of F (L - x)^2 / (E I). Tension: what the part beyond x and the tip mass want, w^2 r."""
    stations = [strip(0.02 * (1.0 - 0.25 * x), x) for x in np.linspace(0.0, LENGTH, 9)]
    beam = {"length": LENGTH, "elements": 24, "section": stations, "modes": fm.Modes(count=2, static=True)}
    x, force, rate, mass = np.linspace(0.0, LENGTH, 20001), 1e-3, 5.0, 0.3
    area = 0.02 * (1.0 - 0.25 * x) * 0.005
    bent = fm.compile(
        fm.SceneBuilder("bent").beam("beam", **beam).weld("clamp", "ground", "beam").marker("end", "beam", node="tip")
        .force("push", "beam", node="tip", direction=(0, 1, 0), function=fm.Constant(value=force)).scene()
    )  # fmt: skip
    rest = fm.equilibrium(bent)
    deflection = np.trapezoid(force * (LENGTH - x) ** 2 / (E * area * 0.005**2 / 12), x)
    assert bent.evaluate(0.0, rest.q, rest.u).markers["end"].position[1] == pytest.approx(deflection, rel=1e-6)
    at = np.array([0, 5000, 10000])
    stress = bent.section_loads(rest, "beam", x[at]).normal_stress(E, y=0.0025, z=0.0)
    np.testing.assert_allclose(stress, -force * (LENGTH - x[at]) * 0.0025 / (area[at] * 0.005**2 / 12), rtol=1e-5)
    spun = fm.compile(
        fm.SceneBuilder("spun").beam("beam", level="stiffened", **beam).revolute("hub", "ground", "beam")
        .rigid_body("end", mass=mass, inertia=(1e-9, 1e-9, 1e-9)).weld("end", "beam", "end", parent_node="tip").scene()
    )  # fmt: skip
    tension = spun.section_loads(fm.steady_spin(spun, "hub", rate).state, "beam", x[at]).axial
    beyond = [np.trapezoid((RHO * area * rate**2 * x)[i:], x[i:]) for i in at]
    np.testing.assert_allclose(tension, np.array(beyond) + mass * rate**2 * LENGTH, rtol=1e-5)


def test_loads_of_a_free_vibration_converge() -> None:
    """A cantilever let go from its deflection under a tip force F: at first its root has the moment F L, the shear F.

    Of sums of modes, the error of the moment falls as the square of their number, that of the shear as the number
    itself: at the tip, shear jumps from F to 0 when it is let go, which sums of modes follow slowly.
    """
    force, errors = 1e-3, []
    for count in (2, 4, 8):
        wanted = fm.Modes(count=count, families=("bending_y",))
        beam = fm.SceneBuilder("let go").beam("beam", length=LENGTH, elements=12, section=SECTION, modes=wanted)
        system = fm.compile(beam.weld("clamp", "ground", "beam").scene())
        link = system.links[0]
        eta = force * link.node("tip").translation[1] / np.diag(link.model.stiffness)
        found = system.section_loads(system.state(eta, np.zeros(count)), "beam", [0.0])
        errors.append([abs(found.bending[0, 1] / (force * LENGTH) - 1.0), abs(found.shear[0, 0] / force - 1.0)])
    moment, shear = np.array(errors).T
    assert moment[0] < 0.05 and shear[0] < 0.4
    assert np.all(moment[:-1] / moment[1:] > 3.0) and np.all(shear[:-1] / shear[1:] > 1.8), errors


def test_one_mode_against_its_closed_form() -> None:
    """The first mode of a clamped-free beam at its largest deflection: EI times its second and third derivatives."""
    beta = 1.875104068711961
    s = (np.cosh(beta) + np.cos(beta)) / (np.sinh(beta) + np.sin(beta))
    x = np.linspace(0.0, LENGTH, 9)
    z = beta * x / LENGTH
    size = 1e-6 / 2.0  # m at the tip, where the shape cosh - cos - s (sinh - sin) is 2
    second = (np.cosh(z) + np.cos(z) - s * (np.sinh(z) + np.sin(z))) * (beta / LENGTH) ** 2 * size
    third = (np.sinh(z) - np.sin(z) - s * (np.cosh(z) + np.cos(z))) * (beta / LENGTH) ** 3 * size
    wanted = fm.Modes(count=1, families=("bending_y",))
    beam = fm.SceneBuilder("first mode").beam(
        "beam", length=LENGTH, elements=12, section=SECTION, modes=wanted, points="line"
    )
    system = fm.compile(beam.weld("clamp", "ground", "beam").scene())
    shape = system.links[0].node("tip").translation[1, 0]
    found = system.section_loads(system.state(np.array([1e-6 / shape]), np.zeros(1)), "beam", x)
    EI = E * IZ
    np.testing.assert_allclose(found.bending[:, 1], EI * second, atol=1e-7 * EI * np.max(np.abs(second)))
    np.testing.assert_allclose(found.shear[:, 0], -EI * third, atol=1e-7 * EI * np.max(np.abs(third)))


def test_over_a_run() -> None:
    """(T,X): the same as state by state, in the order asked for, at a cost of about a millisecond a state."""
    system = fm.compile(everything())
    trajectory = fm.simulate(system, 0.02, samples=5, rtol=1e-6, atol=1e-8)
    x = [1.5, 0.0, 0.5]
    found = trajectory.section_loads("beam", x)
    assert found.load.shape == (5, 3, 6) and found.axial.shape == (5, 3) and found.shear.shape == (5, 3, 2)
    at = system.section_loads(system.state(trajectory.q[3], trajectory.u[3], trajectory.t[3]), "beam", x)
    np.testing.assert_array_equal(at.load, found.load[3])
    begun = perf_counter()
    trajectory.section_loads("beam", np.linspace(0.0, LENGTH, 21))
    assert perf_counter() - begun < 1.0  # some 20 ms where nobody else is at work


def test_a_turning_point_turns_as_its_path_does() -> None:
    """Velocity and acceleration against differences of R(t), theta(t) a parabola; at rest and near half a turn too."""
    random = np.random.default_rng(2)
    theta, rate, again = random.normal(size=(3, 6, 3))
    theta[0], theta[1] = 0.0, theta[1] / np.linalg.norm(theta[1]) * 3.0
    R, omega, alpha = turning(theta, rate, again)
    h = 1e-4

    def at(t: float) -> tuple[np.ndarray, ...]:
        return turning(theta + t * rate + 0.5 * t * t * again, rate + t * again, again)

    ahead, behind = at(h), at(-h)
    spin = (ahead[0] - behind[0]) / (2.0 * h) @ np.swapaxes(R, 1, 2)
    np.testing.assert_allclose(spin[:, [2, 0, 1], [1, 2, 0]], omega, atol=1e-6)
    np.testing.assert_allclose((ahead[1] - behind[1]) / (2.0 * h), alpha, atol=1e-6)


def test_what_is_no_beam_and_not_on_it_is_refused() -> None:
    system = fm.compile(everything())
    state = system.initial_state
    with pytest.raises(ValueError, match='"hub" is no beam of the scene; these are: beam'):
        system.section_loads(state, "hub", [0.0])
    for wrong in (-0.1, 2.1, [[0.0]], np.nan):
        with pytest.raises(ValueError, match="x"):
            system.section_loads(state, "beam", wrong)


@pytest.mark.parametrize("elements", [5, 10])
def test_lumped_masses_step_at_nodes_by_what_the_warning_says(elements: int) -> None:
    """A level beam under its weight: half an element's weight just beside a node, nothing half-way between two."""
    made = fm.SceneBuilder("shelf", gravity=(0.0, -9.81, 0.0)).beam(
        "rod", length=1.0, elements=elements, section=SECTION, mass="lumped", level="rigid", modes=1
    )
    system = fm.compile(made.weld("wall", "ground", "rod").scene())
    half = 0.5 / elements
    x = np.sort(np.r_[half + np.arange(elements) / elements, 2 * half + 1e-9])
    with pytest.warns(fm.SceneWarning, match=f"{50.0 / elements:.2g} % of that at the root"):
        loads = system.section_loads(system.initial_state, "rod", x)
    weight = system.hinge_loads(system.initial_state)["wall"][4]
    off = np.abs(np.abs(loads.shear[:, 0]) - abs(weight) * (1.0 - x)) / abs(weight)
    beside = np.isclose(x, 2 * half + 1e-9, rtol=0.0, atol=1e-12)
    assert off[beside] == pytest.approx(half, rel=1e-6) and np.max(off[~beside]) < 1e-12
    moment = np.abs(np.abs(loads.bending[:, 1]) - 0.5 * abs(weight) * (1.0 - x) ** 2) / (0.5 * abs(weight))
    assert np.max(moment) == pytest.approx(0.25 / elements**2, rel=1e-6)
