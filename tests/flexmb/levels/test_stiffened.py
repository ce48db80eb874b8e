"""Level stiffened: buckling loads, rotating beams, and what summing over few masses leaves out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

import flexmb
from flexmb.dense import DenseSystem
from flexmb.entry.tangent import tangent_workspace
from flexmb.modal.flexible import beam_model
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.shapes import beam_section
from flexmb.tables.state import pack
from flexmb.typing import Real
from tests import trees
from tests.bounds import algebra, observed_order, relative
from tests.flexmb.entry.dual_jacobian import jacobian

EULER = np.pi**2 / 4.0  # tip load, EI / L^2
GREENHILL = 7.837347438  # own weight per length, EI / L^3: first zero of J_-1/3
PRANDTL = 4.012599  # transverse tip load, sqrt(EI GJ) / L^2: first zero of J_-1/4(P/2)
# Flapping of a rotating cantilever, hub of zero radius, in sqrt(EI / (m' L^4)), by rate of spin in the same unit.
# Wright, Smith, Thresher, Wang, J. Appl. Mech. 49 (1982) 197; as in Bir, AIAA 2009-1035, table 3a.
FLAPPING = {
    0: (3.516015, 22.034492, 61.697214), 1: (3.681647, 22.181011, 61.841763), 2: (4.137320, 22.614922, 62.273184),
    4: (5.585001, 24.273349, 63.966760), 6: (7.360373, 26.809082, 66.683914), 10: (11.202328, 33.640366, 74.649295),
    12: (13.170150, 37.603112, 79.614478),
}  # fmt: skip
PRINTED = 0.5e-6
STEP = 2.0**-7  # large against rounding, small against the deflections at which cubic terms prevail


def cantilever(
    modes: int, families: tuple[str, ...], *, level: s.Level = "stiffened", elements: int = 8, EIy: float = 1.0,
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0), rotary: float = 0.0,
) -> SceneBuilder:  # fmt: skip
    """Length, mass per length, EIz and GJ of 1; not hinged yet."""
    section = s.BeamStation(
        x_m=0.0, EA_N=1e4, EIy_Nm2=EIy, EIz_Nm2=1.0, GJ_Nm2=1.0, mass_per_length_kg_m=1.0, rotary_y_kg_m=rotary,
        rotary_z_kg_m=rotary,
    )  # fmt: skip
    return SceneBuilder("cantilever", gravity=gravity).beam(
        "beam", length=1.0, elements=elements, section=section, level=level,
        modes=s.Modes(count=modes, families=families), points="section" if rotary else "line",
    )  # fmt: skip


def stiffness(system: flexmb.System, speed: float = 0.0) -> Real:
    """d(bias)/d(eta) of the straight beam with the first hinge turning at `speed`.

    The bias of masses that do not turn is a cubic polynomial in eta, for which the five-point formula is exact.
    """
    rest, modes, rows = system.initial_state, system.coordinate("beam.modes"), system.speed("beam.modes")
    u, columns = rest.u.copy(), []
    u[: rows.start] = speed
    for n in range(modes.start, modes.stop):
        column = np.zeros(rows.stop - rows.start)
        for steps, weight in ((1, 8.0), (-1, -8.0), (2, -1.0), (-2, 1.0)):
            q = rest.q.copy()
            q[n] = steps * STEP
            column += weight / (12.0 * STEP) * system.bias(system.state(q, u))[rows]
        columns.append(column)
    return np.array(columns).T


def clamped(beam: SceneBuilder) -> Real:
    """Stiffness of the beam with its root welded to the ground."""
    return stiffness(flexmb.compile(beam.weld("clamp", "ground", "beam").scene()))


def critical(unloaded: SceneBuilder, loaded: SceneBuilder) -> float:
    """Smallest factor of the load at which the stiffness is singular."""
    K, K_loaded = clamped(unloaded), clamped(loaded)
    return 1.0 / eigh(K - K_loaded, K, eigvals_only=True)[-1]


@pytest.mark.parametrize(("modes", "tip", "weight"), [(1, 1.0780, 1.0041), (2, 1.0058, 1.0020), (4, 1.0009, 1.0001)])
def test_columns_buckle(modes, tip, weight):
    """From above, as assumed shapes do; to 0.1 % with 4 modes."""
    plane = ("bending_y",)
    load = cantilever(modes, plane).force("P", "beam", node="tip", direction=(-1, 0, 0), function=s.Constant(value=1.0))
    assert critical(cantilever(modes, plane), load) / EULER == pytest.approx(tip, abs=5e-5)
    own_weight = cantilever(modes, plane, gravity=(-1.0, 0.0, 0.0))
    assert critical(cantilever(modes, plane), own_weight) / GREENHILL == pytest.approx(weight, abs=5e-5)


def test_an_outboard_body_loads_the_column_as_a_force_does():
    """Its weight passes through the hinge; a column of one mass at the tip and no weight of its own."""
    plane, P = ("bending_y",), 2.0
    bare = cantilever(4, plane)
    force = cantilever(4, plane).force("P", "beam", node="tip", direction=(-1, 0, 0), function=s.Constant(value=P))
    own, weight = (cantilever(4, plane, gravity=(g, 0.0, 0.0)) for g in (-1.0, -1.0))
    weight.rigid_body("bob", mass=P, inertia=np.eye(3)).spherical("pin", "beam", "bob", parent_node="tip")
    K = clamped(bare)
    by_force, by_weight = clamped(force) - K, clamped(weight) - clamped(own)
    assert relative(by_weight, by_force, scale=K) <= algebra(8, 2, 48)


@pytest.mark.parametrize("EIy", [10.0, 100.0])
def test_strips_buckle_sideways(EIy):
    """A narrow strip under a transverse tip load: its field turns and moves sections sideways.

    Prandtl's load leaves out the deflection before buckling; so does the stiffness of the straight beam.
    """
    families = ("torsion", "bending_y", "bending_z")
    free, load = (cantilever(16, families, elements=16, EIy=EIy, rotary=0.01) for _ in range(2))
    load.force("P", "beam", node="tip", direction=(0, 0, 1), function=s.Constant(value=1.0))
    assert critical(free, load) == pytest.approx(PRANDTL, rel=1e-3)


def test_without_the_field_no_load_stiffens():
    """The negative control: at level full a tip load does nothing."""
    bare, loaded = (cantilever(4, ("bending_y",), level="full") for _ in range(2))
    loaded.force("P", "beam", node="tip", direction=(-1, 0, 0), function=s.Constant(value=1.0))
    assert np.array_equal(clamped(bare), clamped(loaded))


def spinning(modes: int, elements: int, plane: str, level: s.Level = "stiffened") -> flexmb.System:
    beam = cantilever(modes, (plane,), elements=elements, level=level)
    return flexmb.compile(beam.revolute("hub", "ground", "beam", axis=(0.0, 0.0, 1.0)).scene())


def frequencies(system: flexmb.System, speed: float) -> Real:
    """Of the modes at prescribed spin. One plane has no gyroscopic coupling; modal masses are 1."""
    return np.sqrt(eigh(stiffness(system, speed), eigvals_only=True)[:3])


def test_six_modes_follow_the_rotating_beam():
    """Out of the plane to 0.1 %; in the plane omega^2 is less by the square of the spin."""
    flap, lag = spinning(6, 12, "bending_z"), spinning(6, 12, "bending_y")
    for speed, published in FLAPPING.items():
        found = frequencies(flap, speed)
        assert found == pytest.approx(published, rel=1e-3)
        assert frequencies(lag, speed) == pytest.approx(np.sqrt(found**2 - speed**2), rel=1e-9)


def test_six_modes_of_the_prototype():
    """The figures that an independent brute-force sum of the same field gave."""
    assert frequencies(spinning(3, 12, "bending_z"), 12.0) == pytest.approx([13.2036, 37.7626, 79.8784], abs=5e-5)
    assert frequencies(spinning(6, 12, "bending_z"), 12.0) == pytest.approx([13.1728, 37.6120, 79.6379], abs=5e-5)


@pytest.mark.slow
def test_many_modes_reach_the_last_printed_digit():
    """Errors fall with the fourth power of the modes: a spinning beam has w'''' != 0 at the root, clamped modes do not.

    Of the step from 40 to 60 modes a quarter remains.
    """
    coarse, fine = spinning(40, 40, "bending_z"), spinning(60, 40, "bending_z")
    for speed, published in FLAPPING.items():
        a, b = frequencies(coarse, speed), frequencies(fine, speed)
        assert np.all(np.abs(b - published) <= PRINTED + np.abs(b - a) / (1.5**4 - 1.0)), speed


@pytest.mark.parametrize("level", ["full", "linear"])
def test_other_levels_lose_the_plane_of_the_spin(level):
    """The negative control: their stiffness is singular at the first frequency of the beam at rest."""
    system = spinning(4, 12, "bending_y", level)
    lowest = [eigh(stiffness(system, speed), eigvals_only=True)[0] for speed in (3.515, 3.517)]
    assert lowest[0] > 0.0 > lowest[1]
    assert eigh(stiffness(spinning(4, 12, "bending_y"), 3.517), eigvals_only=True)[0] > 10.0


def test_half_of_a_free_beam_is_a_hinged_one():
    """A free beam spinning flatly about its middle flaps as two beams hinged there: free-free modes, moving root."""
    speed, length, rotary = 3.0, 2.0, 1e-6
    section = s.BeamStation(
        x_m=0.0, EA_N=1e4, EIy_Nm2=1.0, EIz_Nm2=1.0, GJ_Nm2=1.0, mass_per_length_kg_m=1.0, rotary_y_kg_m=rotary,
        rotary_z_kg_m=rotary,
    )  # fmt: skip

    def beam(boundary: str, count: int, length: float) -> SceneBuilder:
        modes = s.Modes(count=count, boundary=boundary, families=("bending_z",))
        return SceneBuilder("beam").beam(
            "beam", length=length, elements=16, section=section, level="stiffened", modes=modes
        )

    free = beam("free-free", 14, length).free(
        "free", "ground", "beam", angular_velocity=(0.0, 0.0, speed), velocity=(0.0, -0.5 * speed * length, 0.0),
        position=(-0.5 * length, 0.0, 0.0),
    )  # fmt: skip
    half = (
        beam("clamped-free", 24, 0.5 * length)
        .rigid_body("hub", mass=1.0, inertia=np.eye(3))
        .revolute("spin", "ground", "hub", axis=(0.0, 0.0, 1.0), prescribed=s.Ramp(rate=speed))
        .revolute("flap", "hub", "beam", axis=(0.0, 1.0, 0.0))
    )
    odd, hinged = oscillations(free), oscillations(half)
    along, across = 2.0 * rotary, 1.0 / 3.0 + rotary
    assert hinged[0] == pytest.approx(speed * np.sqrt((across - along) / across), rel=1e-8)  # as a rigid body
    for omega in hinged[1:3]:
        assert np.min(np.abs(odd - omega)) < 2e-4 * omega


def oscillations(scene: SceneBuilder) -> Real:
    """Angular frequencies above zero of motions about the steady one, which place and attitude do not matter to."""
    system = flexmb.compile(scene.scene())
    state, n = system.initial_state, system.nq + system.nu + 1
    J, w = np.zeros((n, n)), tangent_workspace(system.constants, system.nq, system.nu)
    assert jacobian(0.0, pack(state), J, system.constants, w) == 0
    modes = system.coordinate("beam.modes")
    flaps = [system.coordinate("flap").start] if "flap" in {hinge.name for hinge in system.scene.hinges} else []
    kept = [*flaps, *range(modes.start, modes.stop), *range(system.nq, system.nq + system.nu)]
    values = np.linalg.eigvals(J[np.ix_(kept, kept)])
    assert np.max(np.abs(values.real)) < 1e-6 * np.max(np.abs(values))
    return np.unique(np.round(values.imag[values.imag > 1e-3], 9))


def test_few_masses_move_as_all_points_but_for_the_fourth_order():
    """Kinetic energy and momentum of a spinning beam with its lumps, and a mass matrix no larger than the true one."""
    section = beam_section(E=2e9, G=8e8, A=9e-4, Iy=8e-8, Iz=5e-8, rho=1500.0)
    lump = s.TipMass(x_m=0.7, mass_kg=0.2, com_m=(0.0, 0.05, 0.02))
    scene = (
        SceneBuilder("beam")
        .beam("beam", length=1.0, elements=3, section=section, modes=5, level="stiffened", tip_masses=[lump])
        .spherical("hub", "ground", "beam", angular_velocity=(1.0, -2.0, 3.0))
        .modal_state("beam", coordinates=(0.05, 0.03, -0.02, 0.04, 0.01), rates=(0.3, -0.2, 0.1, 0.2, -0.3))
        .scene()
    )
    few, all_points, system = DenseSystem(scene), DenseSystem(scene), flexmb.compile(scene)
    tree = all_points.tree
    (member,) = tree.members
    all_points.tree = replace(tree, members=[replace(member, model=beam_model(scene.bodies[0]))])
    assert len(member.model.mass) < 0.5 * len(all_points.points.mass)
    scales, energy, momentum = 0.5 ** np.arange(6), [], []
    for scale in scales:
        state = system.initial_state
        state.q[system.coordinate("beam.modes")] *= scale
        state.u[system.speed("beam.modes")] *= scale
        lost = all_points.mass_matrix(state.q) - few.mass_matrix(state.q)
        assert np.linalg.eigvalsh(lost)[0] >= -algebra(all_points.nu, 1, len(all_points.points.mass))
        energy.append(abs(few.energy(state.q, state.u)["kinetic"] - all_points.energy(state.q, state.u)["kinetic"]))
        momentum.append(np.linalg.norm(few.momentum(state.q, state.u) - all_points.momentum(state.q, state.u)))
    assert observed_order(scales, energy, floor=1e-15) == pytest.approx(4.0, abs=0.1)
    assert observed_order(scales, momentum, floor=1e-15) == pytest.approx(4.0, abs=0.1)


def test_the_mass_matrix_stays_positive_whatever_the_deflection():
    """Sums of squares: where level linear has left its range, at deflections as large as the body."""
    scene = trees.random_scene(5, replace(trees.STIFFENED, bodies=4, levels=("stiffened",), deformation=1.0))
    system = flexmb.compile(scene)
    assert np.linalg.eigvalsh(system.mass_matrix(system.initial_state))[0] > 0.0


@pytest.mark.parametrize("algorithm", ["frisch", "frisch_as_printed"])
def test_equations_of_first_order_refuse_it(algorithm):
    system = spinning(2, 4, "bending_y")
    with pytest.raises(ValueError, match='body "beam": .* no geometric stiffness.*use level "linear" or "full"'):
        system.accelerations(system.initial_state, algorithm)
