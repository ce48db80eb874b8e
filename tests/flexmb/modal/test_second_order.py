"""Second-order fields: of beams against their exact kinematics, of raw bodies against stiffness under unit loads."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import flexmb
from flexmb.modal import flexible_model
from flexmb.modal.beam import beam_elements
from flexmb.modal.flexible import beam_model
from flexmb.modal.flexible_model import SecondOrder
from flexmb.modal.reduce import beam_modes
from flexmb.modal.stations import inertia_stations, lumps
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.modal_data import inertia_points
from flexmb.surrogate import modal_points
from flexmb.typing import Real
from tests.bounds import algebra, gamma, observed_order, relative

MODES = 14
SCALES = 0.5 ** np.arange(5)


def tapered(boundary: str = "clamped-free", theory: str = "euler-bernoulli", families=None, count=MODES) -> s.BeamBody:
    """Bends, twists and stretches; a lump off the axis couples its families."""
    stations = tuple(
        s.BeamStation(
            x_m=x, EA_N=1e5 * a, EIy_Nm2=20.0 * a, EIz_Nm2=30.0 * a, GJ_Nm2=15.0, mass_per_length_kg_m=a,
            rotary_y_kg_m=1e-3, rotary_z_kg_m=2e-3, GAy_N=3e3, GAz_N=2e3,
        )
        for x, a in ((0.0, 1.0), (1.3, 0.6))
    )  # fmt: skip
    modes = s.Modes(count=count, boundary=boundary, families=families)
    lump = s.TipMass(x_m=0.8, mass_kg=0.2, com_m=(0.0, 0.05, 0.02))
    return s.BeamBody(
        name="beam", length_m=1.3, elements=3, stations=stations, modes=modes, theory=theory, level="stiffened",
        tip_masses=(lump,),
    )  # fmt: skip


def exact_axis(body: s.BeamBody, eta: Real, x: Real) -> list[tuple[Real, Real]]:
    """Positions (S,3) and rotations (S,3,3) at ascending x for S sets of coordinates `eta` (S,m), integrated together.

    R' = R kappa~ and r' = R (e_x + Gamma), from the root.
    """
    elements = beam_elements(body)
    M = elements.mass(inertia_stations(body, elements.mesh, elements.table), lumps(body))
    columns = beam_modes(elements, elements.stiffness(), M, body.modes).columns

    def slope(at: float, y: Real) -> Real:
        strain, curvature = (eta @ each[0].T for each in elements.strain(np.array([at]), columns))
        R = y.reshape(-1, 4, 3)[:, 1:]
        rates = [(R @ (strain + [1.0, 0.0, 0.0])[..., None]).swapaxes(1, 2), np.cross(R, curvature[:, None])]
        return np.concatenate(rates, axis=1).ravel()

    root = flexible_model(body).nodes["root"]
    turned = Rotation.from_rotvec(eta @ root.rotation_modes.T).as_matrix()
    y = np.concatenate([(eta @ root.translation.T)[:, None], turned], axis=1).ravel()
    breaks, found = np.union1d(elements.mesh.nodes, x), {0.0: y}
    for start, stop in zip(breaks, breaks[1:], strict=False):
        inside = (start + 1e-15, stop - 1e-15)  # fields have kinks at nodes
        found[stop] = solve_ivp(slope, inside, found[start], rtol=1e-12, atol=1e-14).y[:, -1]
    states = (found[at].reshape(-1, 4, 3) for at in x)
    return [(state[:, 0], state[:, 1:]) for state in states]


def quadratic(G: Real, eta: Real) -> Real:
    return 0.5 * np.einsum("...mn,m,n->...", G, eta, eta)


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("boundary", ["clamped-free", "free-free"])
def test_field_is_the_beam_but_for_the_third_order(boundary, theory):
    """Tip, and a mass off the axis in the middle of the beam; without the field the error is of second order."""
    body = tapered(boundary, theory)
    model = beam_model(body)
    j = int(np.argmin(np.abs(model.position[:, 0] - 0.6)))
    tip, x = model.nodes["tip"], model.position[j, 0]
    shape = np.random.default_rng(3).normal(size=MODES) * 0.1 / (1.0 + np.arange(MODES)) ** 1.5
    errors: dict[str, list[float]] = {"tip": [], "turn": [], "point": [], "linear tip": []}
    at_mass, at_tip = exact_axis(body, SCALES[:, None] * shape, np.array([x, body.length_m]))
    for eta, r_j, R_j, r, R in zip(SCALES[:, None] * shape, *at_mass, *at_tip, strict=True):
        linear = tip.position + tip.translation @ eta
        turn = Rotation.from_rotvec(tip.rotation_modes @ eta + quadratic(tip.second.rotation, eta)).as_matrix()
        offset = model.position[j] - [x, 0.0, 0.0]
        point = model.position[j] + model.translation[j] @ eta + quadratic(model.second.translation[j], eta)
        errors["tip"].append(np.linalg.norm(linear + quadratic(tip.second.translation, eta) - r))
        errors["turn"].append(np.linalg.norm(turn - R))
        errors["point"].append(np.linalg.norm(point - r_j - R_j @ offset))
        errors["linear tip"].append(np.linalg.norm(linear - r))
    for name, order in {"tip": 3, "turn": 3, "point": 3, "linear tip": 2}.items():
        assert observed_order(SCALES, errors[name], floor=1e-11) == pytest.approx(order, abs=0.1), name


def test_bending_in_a_plane_shortens_the_axis():
    """G = -int v_m' v_n' dx along the axis and nothing else; 15 Gauss points a piece are more than exact."""
    body = tapered(families=("bending_y",), count=5)
    body = replace(body, tip_masses=())
    elements = beam_elements(body)
    M = elements.mass(inertia_stations(body, elements.mesh, elements.table), ())
    columns = beam_modes(elements, elements.stiffness(), M, body.modes).columns
    at, weight = np.polynomial.legendre.leggauss(15)
    half = body.length_m / 6.0
    x = (half * (2.0 * np.arange(3)[:, None] + 1.0 + at)).ravel()
    slope = elements.motion(x, columns)[:, 5]
    tip = flexible_model(body).nodes["tip"].second
    shortening = -np.einsum("p,pm,pn->mn", np.tile(half * weight, 3), slope, slope)
    assert relative(tip.translation[0], shortening) <= gamma(50)
    assert not np.any(tip.translation[1:]) and not np.any(tip.rotation)


def test_a_beam_without_level_stiffened_has_no_field():
    model = flexible_model(replace(tapered(), level="full"))
    assert model.second is None and model.nodes["tip"].second is None


def test_points_of_a_beam_move_as_the_beam():
    """The scene in raw points and modes is the same system."""
    scene = (
        SceneBuilder("beam", gravity=(1.0, 2.0, -9.81))
        .beam("beam", length=1.3, elements=3, section=tapered().stations, modes=tapered().modes, level="stiffened")
        .revolute("hub", "ground", "beam", axis=(0.0, 0.6, 0.8), angle=0.3, rate=2.0)
        .force("push", "beam", node="tip", direction=(0.0, 0.0, 1.0), function=s.Constant(value=3.0))
        .modal_state("beam", coordinates=np.full(MODES, 0.01), rates=np.full(MODES, 0.02))
        .scene()
    )
    beam, points = flexmb.compile(scene), flexmb.compile(modal_points(scene))
    state, bound = beam.initial_state, algebra(beam.nu, 1, len(points.scene.bodies[0].points))
    for quantity in (flexmb.System.mass_matrix, flexmb.System.bias):
        assert relative(quantity(beam, state), quantity(points, state)) <= bound


# Raw bodies


RAW, RAW_MODES = 6, 3


class Raw:
    """Random points, modes and a field that does not turn; node "tip" too."""

    def __init__(self, flat: bool = False) -> None:
        rng = np.random.default_rng(7)
        self.mass, self.position = rng.uniform(0.5, 1.0, RAW), rng.uniform(-1.0, 1.0, (RAW, 3))
        self.position[:, 1] *= not flat
        self.shapes = rng.uniform(-1.0, 1.0, (RAW, 3, RAW_MODES))
        G = rng.uniform(-1.0, 1.0, (RAW, 3, RAW_MODES, RAW_MODES))
        self.field = G + np.swapaxes(G, -1, -2)
        self.node = s.ModalNode(
            name="tip", position_m=(1.0, 0.0, 0.0), rotation_modes=((0.0, 0.0, 0.0),) * RAW_MODES,
            translation_modes=tuple(map(tuple, rng.uniform(-1.0, 1.0, (RAW_MODES, 3)).tolist())),
        )  # fmt: skip
        self.at_node = self.field[0] + 1.0

    @property
    def gravity(self) -> Real:
        """Stiffness under mass forces along each axis: what they do on the field, with the other sign."""
        return -np.einsum("p,pamn->amn", self.mass, self.field)

    @property
    def gradient(self) -> Real:
        """Under mass forces along a that grow with coordinate b."""
        return -np.einsum("p,pb,pamn->abmn", self.mass, self.position, self.field)

    def scene(self, node: s.ModalNode, field: Real | None, level: s.Level = "stiffened", **stiffness) -> s.Scene:
        points = inertia_points(self.mass, self.position, self.shapes, second_translation=field)
        return (
            SceneBuilder("raw", gravity=(1.0, 2.0, 3.0))
            .modal_body(
                "body", points=points, stiffness=100.0 * np.eye(RAW_MODES), boundary="free-free", nodes=[node],
                level=level, **stiffness,
            )
            .revolute("hub", "ground", "body", child_node="tip", axis=(0.0, 0.6, 0.8), rate=2.0)
            .force("push", "body", node="tip", direction=(0.6, 0.0, 0.8), function=s.Constant(value=2.0))
            .modal_state("body", coordinates=(0.1, -0.05, 0.08), rates=(0.3, 0.2, -0.1))
            .scene()
        )  # fmt: skip

    def with_field(self) -> s.ModalNode:
        rows = np.moveaxis(self.at_node, 0, -1)
        return replace(self.node, second_translation=tuple(tuple(map(tuple, row)) for row in rows.tolist()))

    def with_stiffness(self) -> s.ModalNode:
        return replace(self.node, force_stiffness=tuple(tuple(map(tuple, each)) for each in (-self.at_node).tolist()))


def test_unit_loads_tell_what_the_field_would():
    """All stiffening: what is left is of third order in the kinetic energy, of second in the forces."""
    raw = Raw()
    field = flexmb.compile(raw.scene(raw.with_field(), raw.field))
    loads = flexmb.compile(
        raw.scene(raw.with_stiffness(), None, gravity_stiffness=raw.gravity, gradient_stiffness=raw.gradient)
    )
    scales, energy, force = 0.5 ** np.arange(8), [], []
    for scale in scales:
        state = field.initial_state
        state.q[field.coordinate("body.modes")] *= scale
        state.u[field.speed("body.modes")] *= scale
        energy.append(abs(field.energy(state)["kinetic"] - loads.energy(state)["kinetic"]))
        force.append(np.linalg.norm(field.bias(state) - loads.bias(state)))
    assert observed_order(scales, energy, floor=1e-14) == pytest.approx(3.0, abs=0.1)
    assert observed_order(scales, force, floor=1e-13) == pytest.approx(2.0, abs=0.1)


def test_only_the_symmetric_part_acts():
    raw = Raw()
    noise = np.random.default_rng(1).normal(size=raw.field.shape)
    fields = raw.field, raw.field + noise - np.swapaxes(noise, 2, 3)
    a, b = (flexmb.compile(raw.scene(raw.with_field(), field)) for field in fields)
    assert relative(a.bias(a.initial_state), b.bias(b.initial_state)) <= gamma(100)


def test_a_load_that_no_mass_feels_is_refused():
    flat = Raw(flat=True)
    scene = flat.scene(flat.with_field(), None, gravity_stiffness=flat.gravity, gradient_stiffness=Raw().gradient)
    with pytest.raises(ValueError, match="'body'.*forces along . that grow with y.*no extent along y"):
        flexmb.compile(scene)
    in_plane = flat.scene(flat.with_field(), None, gravity_stiffness=flat.gravity, gradient_stiffness=flat.gradient)
    flexmb.compile(in_plane)


@pytest.mark.parametrize(
    ("message", "node", "field", "stiffness"),
    [
        ("needs a second-order field.*give second_translation.*or use", "field", False, {}),
        ("nothing says how a load at this node stiffens.*force_stiffness", "bare", True, {}),
        ("both second_translation and gravity_stiffness", "field", True, {"gravity_stiffness": Raw().gravity}),
        ("only gravity_stiffness is given.*give both", "field", False, {"gravity_stiffness": Raw().gravity}),
        ('"gravity_stiffness" has shape', "field", False, {"gravity_stiffness": np.ones((2, 3, 3))}),
    ],
)
def test_incomplete_data_are_refused(message, node, field, stiffness):
    raw = Raw()
    with pytest.raises(flexmb.SceneError, match=f"(?s){message}"):
        raw.scene(raw.with_field() if node == "field" else raw.node, raw.field if field else None, **stiffness)


def test_a_field_is_left_alone_at_other_levels():
    raw = Raw()
    with_field = flexmb.compile(raw.scene(raw.with_field(), raw.field, level="full"))
    without = flexmb.compile(raw.scene(raw.node, None, level="full"))
    assert relative(with_field.bias(with_field.initial_state), without.bias(without.initial_state)) == 0.0
    assert len(with_field.constants.second_shape) == 0


def test_fields_turn_with_their_axes():
    G = np.random.default_rng(0).normal(size=(3, 2, 2))
    turn = Rotation.from_rotvec([0.3, -0.2, 0.9]).as_matrix()
    turned = SecondOrder(G, 2.0 * G).turned(turn)
    assert relative(turned.translation[:, 0, 1], turn @ G[:, 0, 1]) <= gamma(6)
    assert relative(turned.rotation, 2.0 * turned.translation) <= gamma(6)
