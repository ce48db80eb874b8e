"""Super-elements against the full finite-element model, closed forms, and flexmb's own beam."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

import flexmb as fm
from flexmb.interchange.sid import imported_sid, sid_of
from flexmb.interchange.superelement import (
    SuperElementError,
    Tie,
    compared,
    interface_of,
    reduced,
    reduction,
    super_element,
)
from flexmb.modal.flexible import flexible_model
from flexmb.modal.integrals import modal_integrals
from tests.bounds import relative
from tests.flexmb.interchange import frames, solids

LENGTH, TIP = 1.0, 21
POSITION, MEMBERS = frames.straight(20, LENGTH)
STIFFNESS = frames.frame(POSITION, MEMBERS)
BEAM = super_element(STIFFNESS, frames.lumped(POSITION, MEMBERS, rotary=1e-7), POSITION)
GRID, BARS = frames.panel()
PANEL_STIFFNESS = frames.frame(GRID, BARS)
MASSES = {
    "lumped": frames.lumped(GRID, BARS),
    "tensors": frames.lumped(GRID, BARS, rotary=1e-5),
    "one kernel": frames.linear(GRID, BARS),
    "coupled": frames.consistent(GRID, BARS),
}


def clamped(element, first: int = 0) -> np.ndarray:
    """Frequencies (Hz) of the full model, clamped at one node."""
    free = np.setdiff1d(np.arange(len(element.K)), element.place[first])
    inverse = eigh(element.M[np.ix_(free, free)], element.K[np.ix_(free, free)], eigvals_only=True)[::-1]
    return 1.0 / (2.0 * np.pi * np.sqrt(inverse[inverse > 1e-12 * inverse[0]]))


def test_a_large_structure_has_the_modes_that_all_of_it_has(monkeypatch):
    """Lanczos' method for few modes of many, against the whole eigenproblem."""
    position, members = frames.panel(7, 8)
    element = super_element(frames.frame(position, members), frames.lumped(position, members), position)
    whole = reduced(element, [1, 56], 6)
    monkeypatch.setattr(reduction, "DENSE", 10)
    assert relative(reduced(element, [1, 56], 6).frequencies, whole.frequencies) < 1e-9


def test_frequencies_are_those_of_the_closed_form_and_of_flexmbs_beam():
    """Cantilever: (beta L)² = 3.516, 22.03; half an element is lumped at the tip, an error ~ 1/(2 n²)."""
    found = reduced(BEAM, [1, TIP], 8).frequencies
    line = frames.RHO * frames.A
    exact = sorted(
        beta**2 * np.sqrt(frames.E * I / line) / (2.0 * np.pi)
        for beta in (1.8751041, 4.6940911)
        for I in (frames.IY, frames.IZ)
    )
    assert relative(found[:2], exact[:2]) < 1.0 / 20**2
    assert relative(found[2:4], exact[2:4]) < 22.0 / 3.5 / 20**2
    section = fm.BeamStation(
        x_m=0.0,
        EA_N=frames.E * frames.A,
        EIy_Nm2=frames.E * frames.IY,
        EIz_Nm2=frames.E * frames.IZ,
        GJ_Nm2=frames.G * frames.J,
        mass_per_length_kg_m=line,
    )
    modes = fm.Modes(count=4, families=("bending_y", "bending_z"))
    builder = fm.SceneBuilder("own").beam(
        "rod", length=LENGTH, elements=20, section=section, modes=modes, mass="lumped", points="line"
    )
    (own,) = builder.weld("root", "ground", "rod").scene().bodies
    frequencies = np.sqrt(np.diag(flexible_model(own).stiffness)) / (2.0 * np.pi)
    assert relative(found[:4], frequencies) < 1e-3


@pytest.mark.parametrize("mass", MASSES)
def test_kinetic_energy_at_rest_shape_is_that_of_the_mass_matrix(mass):
    element = super_element(PANEL_STIFFNESS, MASSES[mass], GRID)
    for boundary in ("clamped-free", "free-free"):
        made = reduced(element, [1, 12], 4, boundary=boundary)
        model = flexible_model(made.body)
        spatial = modal_integrals(model).spatial_mass
        m = model.mode_count
        R = element.rigid(made.origin)[:, [3, 4, 5, 0, 1, 2]]
        assert relative(spatial[m:, m:], R.T @ element.M @ R) < 1e-12
        assert relative(spatial[:m, :m], np.eye(m)) < 1e-9
        V = made.shapes.reshape(-1, m)
        assert relative(spatial[m:, :m], R.T @ element.M @ V, scale=spatial[m:]) < 1e-9
        assert relative(made.mass, float(np.sum(model.mass))) < 1e-13
        assert relative(made.inertia, spatial[m : m + 3, m : m + 3]) < 1e-12
        if boundary == "free-free":
            assert np.max(np.abs(spatial[:m, m:])) < 1e-9 * np.max(np.abs(spatial[m:, m:]))
            assert np.max(np.abs(made.centre)) < 1e-12
        assert (made.notes == ()) == (mass != "coupled")


def test_of_consistent_beams_only_the_change_of_inertia_is_approximate_and_that_is_said():
    element = super_element(PANEL_STIFFNESS, MASSES["coupled"], GRID)
    made = reduced(element, [1, 12], len(element.K) - 12)
    assert "frequencies, mass and inertia at rest are those of M" in made.notes[0]
    assert relative(made.frequencies[:40], clamped(element)[:40]) < 1e-9
    assert "off by 0.06" in reduced(element, [1, 12], 4).notes[0]


def test_mass_that_no_nodes_carry_is_refused():
    """For motions along y, the beam's mass is at its ends and its middle, with the inertia of the whole."""
    M = frames.lumped(POSITION, MEMBERS, rotary=1e-7)
    mass, x = np.diag(M)[0::6], POSITION[:, 0] - LENGTH / 2.0
    end = 2.0 * np.sum(mass * x**2) / LENGTH**2
    along = np.zeros(len(x))
    along[[0, 10, 20]] = end, mass.sum() - 2.0 * end, end
    M[range(1, len(M), 6), range(1, len(M), 6)] = along
    with pytest.raises(SuperElementError, match=r"off by 0\..*, and the limit is 0.25: write a lumped M"):
        reduced(super_element(STIFFNESS, M, POSITION), [1, TIP], 4)


def test_modal_masses_are_exact_for_a_matrix_that_was_printed_to_few_digits():
    """Its rigid-body motions have not quite the inertia of a rigid body, which moved the modal masses by 1e-6."""
    noise = np.random.default_rng(1).normal(size=BEAM.M.shape) * 1e-9
    made = reduced(super_element(STIFFNESS, BEAM.M + noise + noise.T, POSITION), [1, TIP], 4)
    spatial = modal_integrals(flexible_model(made.body)).spatial_mass
    assert relative(spatial[:10, :10], np.eye(10)) < 1e-9


LEVELS = ("ruthless", "linear", "full")
FACES = (0.0, 1.0)


def solid_panel():
    K, M, position = solids.panel()
    K, M, position, dofs = solids.tied(K, M, position, [np.flatnonzero(position[:, 0] == x) for x in FACES])
    return super_element(K, M, position, dofs=dofs)


def craig_bampton(element, interface: int, modes: int):
    """T'KT and T'MT without the first six columns, in plain NumPy; the held rows are the first ones."""
    K, M = element.K, element.M
    fixed = eigh(K[interface:, interface:], M[interface:, interface:])[1][:, :modes]
    static = -np.linalg.solve(K[interface:, interface:], K[interface:, 6:interface])
    T = np.block([[np.eye(interface)[:, 6:], np.zeros((interface, modes))], [static, fixed]])
    return T.T @ K @ T, T.T @ M @ T


def test_a_panel_of_solids_with_tied_faces_has_the_frequencies_of_the_reduced_matrices():
    """With each boundary, and at every level in a scene; lumped at the nodes they were off by 0.6 to 10 %."""
    element = solid_panel()
    for modes in (12, 0, 4):
        exact = np.sqrt(eigh(*craig_bampton(element, 12, modes), eigvals_only=True)) / (2.0 * np.pi)
        made = reduced(element, [1, 2], modes)
        assert made.notes == ()
        assert relative(made.frequencies / exact, np.ones(6 + modes)) < 1e-9
    for boundary, level in (*(("clamped-free", level) for level in LEVELS), ("free-free", "full")):
        body = reduced(element, [1, 2], modes, boundary=boundary, level=level).body
        scene = fm.SceneBuilder("held").add(body).weld("root", "ground", "body", child_node="1").scene()
        A = fm.linearize(fm.compile(scene)).A
        found = np.sort(np.abs(np.linalg.eigvals(A)))[::2] / (2.0 * np.pi)
        assert relative(found / exact, np.ones(6 + modes)) < 1e-9, (boundary, level)


SOLID_K, SOLID_M, SOLID_AT = solids.panel((4, 3, 1))
SOLID = super_element(SOLID_K, SOLID_M, SOLID_AT, dofs=["123"] * len(SOLID_AT))
SURFACES = [tuple(1 + np.flatnonzero(SOLID_AT[:, 0] == x)) for x in FACES]
INNER = 1 + int(np.flatnonzero((SOLID_AT[:, 0] == 0.5) & (SOLID_AT[:, 1] > 0.0))[0])


def test_matrices_of_solids_without_their_dofs_are_refused_with_the_remedy():
    with pytest.raises(SuperElementError, match="K has 120 rows, M 120, .* 240 displacements.*give its dofs as 123"):
        super_element(SOLID_K, SOLID_M, SOLID_AT)


def surfaces(kind: str) -> list[Tie]:
    return [Tie(900 + i, nodes, kind) for i, nodes in enumerate(SURFACES)]  # type: ignore[arg-type]


def constrained(kind: str, modes: int) -> np.ndarray:
    """Frequencies (Hz), the first node held, of the motions of Craig and Bampton by constraints C u = D p, in NumPy."""
    C, D = list[np.ndarray](), list[np.ndarray]()
    for i, nodes in enumerate(SURFACES):
        rows = np.array([3 * (node - 1) + a for node in nodes for a in range(3)])
        at = SOLID_AT[np.array(nodes) - 1]
        R = np.vstack([np.hstack([np.eye(3), -np.cross(np.eye(3), -(r - at.mean(axis=0)))]) for r in at])
        pick = np.eye(len(SOLID_K))[rows]
        C.append(pick if kind == "rigid" else np.linalg.solve(R.T @ R, R.T) @ pick)
        place = np.zeros((len(C[-1]), 12))
        place[:, 6 * i : 6 * i + 6] = R if kind == "rigid" else np.eye(6)
        D.append(place)
    C, D = np.vstack(C), np.vstack(D)
    inner = np.linalg.svd(C)[2][len(C) :].T  # motions with C u = 0
    particular = np.linalg.lstsq(C, D)[0]
    k = inner.T @ SOLID_K @ inner
    static = particular - inner @ np.linalg.solve(k, inner.T @ SOLID_K @ particular)
    fixed = inner @ eigh(k, inner.T @ SOLID_M @ inner)[1][:, :modes]
    T = np.hstack([static[:, 6:], fixed])
    return np.sqrt(eigh(T.T @ SOLID_K @ T, T.T @ SOLID_M @ T, eigvals_only=True)) / (2.0 * np.pi)


def tied(element, numbers, ties, modes, **more):
    """Reduced to these interface nodes, to some of which surfaces are tied."""
    return reduced(element, interface_of(element, numbers, ties), modes, **more)


@pytest.mark.parametrize("kind", ["rigid", "mean"])
def test_tied_surfaces_have_the_frequencies_of_craig_and_bampton(kind):
    """And the free body those of a free-free one that is held at the same node in a scene."""
    exact = constrained(kind, 5)
    made = tied(SOLID, [900, 901], surfaces(kind), 5)
    assert relative(made.frequencies / exact, np.ones(11)) < 1e-9
    assert [node.name for node in made.body.nodes] == ["900", "901"]
    free = tied(SOLID, [900, 901], surfaces(kind), 5, boundary="free-free").body
    held = fm.SceneBuilder("held").add(free).weld("root", "ground", "body", child_node="900").scene()
    found = np.sort(np.abs(np.linalg.eigvals(fm.linearize(fm.compile(held)).A)))[::2] / (2.0 * np.pi)
    assert relative(found / exact, np.ones(11)) < 1e-9


def test_a_rigid_tie_is_the_elimination_of_its_surface():
    K, M, position, dofs = solids.tied(SOLID_K, SOLID_M, SOLID_AT, [np.array(surface) - 1 for surface in SURFACES])
    eliminated = reduced(super_element(K, M, position, dofs=dofs), [1, 2], 4)
    assert relative(tied(SOLID, [900, 901], surfaces("rigid"), 4).frequencies, eliminated.frequencies) < 1e-9


def test_a_tie_may_sit_beside_its_surface():
    """At the same place the same body; elsewhere another lever, and the same frequencies of the free structure."""
    at = [SOLID_AT[np.array(nodes) - 1].mean(axis=0) for nodes in SURFACES]
    moved = [replace(tie, position=tuple(p + [0.1, 0.2, 0.0])) for tie, p in zip(surfaces("mean"), at, strict=True)]
    named = [replace(tie, position=tuple(p)) for tie, p in zip(surfaces("mean"), at, strict=True)]
    plain, same, other = (
        tied(SOLID, [900, 901], ties, 5, boundary="free-free") for ties in (surfaces("mean"), named, moved)
    )
    assert np.array_equal(plain.frequencies, same.frequencies)
    assert relative(plain.frequencies / other.frequencies, np.ones(11)) < 1e-9
    assert np.allclose(other.body.nodes[0].position_m, np.array(plain.body.nodes[0].position_m) + [0.1, 0.2, 0.0])


@pytest.mark.parametrize("modes", [0, 4, len(SOLID_K) - 6 * 8])
def test_an_attached_node_has_the_exact_static_response_to_loads(modes):
    """With all fixed-interface modes the attachment adds nothing."""
    if modes > 4:
        modes = tied(SOLID, [900, 901], surfaces("rigid"), 0).interface.T.shape[1] - 12
    ties = surfaces("rigid")
    made, bare = (tied(SOLID, [900, 901], ties, modes, attached=nodes) for nodes in ([INNER], []))
    node = made.body.nodes[-1]
    assert node.name == str(INNER) and "nodes without rotations" in made.notes[-1]
    assert len(made.frequencies) == 6 + modes + (3 if modes <= 4 else 0)
    shape = np.array(node.translation_modes)
    found = shape.T @ (shape / (2.0 * np.pi * made.frequencies[:, None]) ** 2)
    T = made.interface.T[:, 6:].toarray()
    row = slice(3 * (INNER - 1), 3 * INNER)
    exact = (T @ np.linalg.solve(T.T @ SOLID_K @ T, T.T[:, row]))[row]
    assert relative(found, exact) < 1e-8
    shape = bare.shapes[INNER - 1, :3].T
    without = shape.T @ (shape / (2.0 * np.pi * bare.frequencies[:, None]) ** 2)
    assert (relative(without, exact) > 1e-3) == (modes <= 4)


@pytest.mark.parametrize("boundary", ["clamped-free", "free-free"])
def test_frequencies_and_shapes_stand_beside_those_of_the_structure(boundary):
    """Rayleigh and Ritz: never lower. With all modes they are the structure's, and MAC is 1, for pairs of modes too."""
    few = compared(SOLID, tied(SOLID, [900, 901], surfaces("mean"), 8, boundary=boundary), 5)
    assert np.all(few.reduced >= few.given * (1.0 - 1e-9)) and np.all(few.mac > 0.99)
    poor = compared(SOLID, tied(SOLID, [900, 901], surfaces("mean"), 0, boundary=boundary), 6)
    assert np.min(poor.mac) < 0.99 and np.max(poor.reduced / poor.given) > 1.01
    every = compared(BEAM, reduced(BEAM, [1, TIP], len(BEAM.K) - 12, boundary=boundary), 12)
    assert relative(every.reduced / every.given, np.ones(12)) < 1e-6
    assert relative(every.mac, np.ones(12)) < 1e-6


def test_of_a_panel_of_solids_with_tied_faces_the_whole_kinetic_energy_is_exact():
    """1/2 int v'v of v = v0 + w x (r + u) + u', by the untied matrices: tied faces move rigidly to first order."""
    K, M, position = solids.panel((3, 2, 1))
    faces = [np.flatnonzero(position[:, 0] == x) for x in FACES]
    tied_K, tied_M, nodes, dofs = solids.tied(K, M, position, faces)
    made = reduced(super_element(tied_K, tied_M, nodes, dofs=dofs), [1, 2], 3)
    model = flexible_model(made.body)
    rng = np.random.default_rng(3)
    q, qd = rng.normal(size=(2, model.mode_count)) * 1e-2
    w, v = rng.normal(size=(2, 3))
    free = np.setdiff1d(np.arange(len(position)), np.concatenate(faces))
    shapes = np.zeros((len(position), 3, model.mode_count))
    shapes[free] = made.shapes[2:, :3]
    for i, face in enumerate(faces):
        arm = position[face] - nodes[i]
        shapes[face] = made.shapes[i, :3] + np.cross(made.shapes[None, i, 3:], arm[:, :, None], axis=1)

    def energy(position, shapes, kernel):
        u = v + np.cross(w, position + shapes @ q) + shapes @ qd
        return 0.5 * np.einsum("ia,ij,ja->", u, kernel, u)

    whole = energy(position - made.origin, shapes, M[::3, ::3])
    assert relative(energy(model.position, model.translation, np.diag(model.mass)), whole) < 1e-12


def test_one_interface_node_has_no_static_modes_of_its_own():
    """Its six motions are rigid: with all fixed-interface modes, those of the free structure remain."""
    made = reduced(BEAM, [1], len(BEAM.K) - 6, boundary="free-free")
    free = eigh(BEAM.M, BEAM.K + 1e6 * BEAM.M, eigvals_only=True)[::-1]
    found = np.sqrt(np.maximum(1.0 / free - 1e6, 0.0)) / (2.0 * np.pi)
    assert relative(made.frequencies[:12] / found[6:18], np.ones(12)) < 1e-6


def assembled(made, base: str) -> fm.Scene:
    """The structure on a hinge, a rigid body at its far node."""
    return (
        fm.SceneBuilder("arm")
        .add(made.body)
        .rigid_body("load", mass=0.2, com=(0.03, 0.0, 0.0), inertia=(1e-3, 2e-3, 2e-3))
        .revolute("pivot", "ground", "body", child_node=base, axis=(0, 1, 0), stiffness=50.0)
        .revolute("wrist", "body", "load", parent_node="21", axis=(0, 0, 1), stiffness=1.0)
        .marker("end", "body", node="21")
        .scene()
    )


def test_a_tip_load_bends_it_by_the_closed_form_and_comes_back_at_the_root():
    """F L³ / (3 EI): static modes of the interface are exact. Axial and bending loads at the root balance F."""
    made = reduced(BEAM, [1, TIP], 2)
    force = 1e-3
    scene = (
        fm.SceneBuilder("loaded")
        .add(made.body)
        .weld("root", "ground", "body", child_node="1")
        .force("pull", "body", node="21", direction=(0, 1, 0), function=fm.Constant(value=force))
        .marker("end", "body", node="21")
        .scene()
    )
    system = fm.compile(scene)
    rest = fm.equilibrium(system)
    deflection = system.evaluate(rest.t, rest.q, rest.u).markers["end"].position[1]
    assert relative(deflection, force * LENGTH**3 / (3.0 * frames.E * frames.IZ)) < 1e-6
    load = system.hinge_loads(rest)["root"]
    assert np.allclose(load, [0.0, 0.0, -force * LENGTH, 0.0, -force, 0.0], rtol=0.0, atol=1e-3 * force)


def test_a_reduced_body_goes_through_sid():
    made = reduced(BEAM, [1, TIP], 4)
    back = imported_sid(sid_of(made.body), "body").body
    assert back.boundary == "clamped-free"
    before, after = (modal_integrals(flexible_model(each)) for each in (made.body, back))
    for name in ("mass", "s0", "s1", "J0", "J1", "J2", "C0", "C1", "M_ff"):
        assert relative(getattr(after, name), getattr(before, name)) < 1e-9, name


def spring_to_ground(K):
    K = K.copy()
    K[0, 0] += 1e3
    return K


def cut(K):
    """The last member is gone: node 21 hangs on nothing."""
    return frames.frame(POSITION, MEMBERS[:-1])


def spinning(inertia):
    """Inertia about x alone: above the sum of the others, which no masses have."""
    return np.diag(np.tile([0.0, 0.0, 0.0, inertia, 0.0, 0.0], len(POSITION)))


BAD = {
    "held": (
        lambda: super_element(spring_to_ground(STIFFNESS), BEAM.M, POSITION),
        "resists the rigid-body translation x",
    ),
    "moved node": (lambda: super_element(STIFFNESS, BEAM.M, POSITION[:, [1, 0, 2]]), "resists the rigid-body rotation"),
    "not symmetric": (lambda: super_element(np.triu(STIFFNESS), BEAM.M, POSITION), "K is not symmetric"),
    "mass in x only": (
        lambda: super_element(STIFFNESS, BEAM.M * np.tile([1, 0, 0, 1, 1, 1], 21), POSITION),
        "M is not symmetric|mass of M",
    ),
    "sizes": (lambda: super_element(STIFFNESS[6:, 6:], BEAM.M, POSITION), "K has 120 rows, M 126"),
    "no such node": (lambda: reduced(BEAM, [1, 22], 2), "there is no node 22: the nodes are 1, 2"),
    "too many modes": (lambda: reduced(BEAM, [1, TIP], 115), "115 modes are requested, and .* has 114"),
    "loose part": (lambda: reduced(super_element(cut(STIFFNESS), BEAM.M, POSITION), [1], 2), "move without force"),
    "rigid": (lambda: reduced(BEAM, [1], 0), "is a rigid body: give modes"),
    "damping": (lambda: reduced(BEAM, [1], 2, damping_ratio=-0.1), "the damping ratio is -0.1"),
    "no mean frame": (
        lambda: reduced(
            super_element(STIFFNESS, frames.lumped(POSITION, MEMBERS), POSITION), [1], 2, boundary="free-free"
        ),
        "no mean frame: clamp the first interface node",
    ),
    "no masses": (
        lambda: reduced(super_element(STIFFNESS, BEAM.M + spinning(9e-2), POSITION), [1], 2),
        "M is not a mass matrix",
    ),
    "no interface": (lambda: reduced(BEAM, [], 2), "no interface node"),
    "nan": (lambda: super_element(STIFFNESS * np.nan, BEAM.M, POSITION), r"K\[1,1\] is nan: give finite numbers"),
    "nothing": (lambda: super_element(np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((0, 3))), "no node with"),
    "sums overflow": (lambda: super_element(np.sign(STIFFNESS) * 1e308, BEAM.M, POSITION), "at most 1e\\+60"),
    "far away": (lambda: super_element(STIFFNESS, BEAM.M, POSITION * 1e300), "a coordinate of a node is not finite"),
}


BAD |= {
    "on a line": (
        lambda: tied(SOLID, [900], [Tie(900, SURFACES[0][:4])], 2), "node 900 does not show all six motions"
    ),
    "its number is taken": (lambda: tied(SOLID, [1], [Tie(1, SURFACES[0])], 2), "node 1 is there already"),
    "no interface of it": (lambda: tied(BEAM, [1], [Tie(900, (2, 3))], 2), "900, which is no interface node"),
    "a node twice": (lambda: tied(SOLID, [900], [Tie(900, (1, 1, 2, 7))], 2), "lists a node twice"),
    "shared": (
        lambda: tied(SOLID, [900, 901], [Tie(900, SURFACES[0]), Tie(901, SURFACES[0])], 2),
        "node 901 shares displacements",
    ),
    "far tie": (
        lambda: tied(SOLID, [900], [Tie(900, SURFACES[0], position=(0.0, 0.0, float("nan")))], 2),
        "the position of node 900 is not finite",
    ),
    "no node to attach": (lambda: reduced(BEAM, [1], 2, attached=[77]), "there is no node 77"),
}  # fmt: skip


@pytest.mark.parametrize("fault", BAD)
def test_what_is_no_free_structure_is_refused(fault):
    make, words = BAD[fault]
    with pytest.raises(SuperElementError, match=words):
        make()


def test_an_interface_node_of_a_solid_has_no_rotations():
    rows = np.flatnonzero(np.arange(len(STIFFNESS)) % 6 < 3)
    ends = np.concatenate([rows, [3, 4, 5]])
    ends.sort()
    with pytest.raises(SuperElementError, match="interface node 21 has no rotation x"):
        K = np.zeros((len(ends), len(ends)))
        M = BEAM.M[np.ix_(ends, ends)]
        reduced(super_element(K, M, POSITION, dofs=["123456", *["123"] * 20]), [1, TIP], 1)
