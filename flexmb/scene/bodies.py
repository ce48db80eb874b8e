"""Bodies of a scene: rigid, beam, raw points and modes, SID file; and their nodes."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal, TypeVar

import msgspec
from msgspec import structs

from flexmb.scene.convert import NamedKeys
from flexmb.scene.quantities import (
    PURE,
    UNIT_LENGTH,
    Damping,
    Lump,
    NotNegative,
    Number,
    Positive,
    unit,
    whole,
    within,
)
from flexmb.scene.rounding import ROUNDING

Vector = tuple[Number, Number, Number]
Axis = Annotated[Vector, UNIT_LENGTH]
Quaternion = Annotated[tuple[Number, Number, Number, Number], UNIT_LENGTH]
Matrix3 = tuple[Vector, Vector, Vector]
Row6 = tuple[Number, Number, Number, Number, Number, Number]
Matrix6 = tuple[Row6, Row6, Row6, Row6, Row6, Row6]
Matrix = tuple[tuple[Number, ...], ...]
VectorSquare = tuple[tuple[Vector, ...], ...]
Level = Literal["rigid", "ruthless", "linear", "full", "stiffened", "exact"]
Family = Literal["axial", "torsion", "bending_y", "bending_z"]

IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)
ZERO: Vector = (0.0, 0.0, 0.0)
FAMILIES: tuple[Family, ...] = ("axial", "torsion", "bending_y", "bending_z")


MOST_PIECES, MOST_POLYNOMIALS, MOST_POINTS = 1000, 40, 200
"""Beyond these a number is taken for a slip. The fastest frequency grows with the fourth power of the polynomials: with
40 of them it would be some hundred thousand times the first (docs/exact.md has it for 4, 6 and 8)."""

FINER = f"give 0 to {MOST_POLYNOMIALS}, and more pieces where these are not enough"
Polynomials = Annotated[int, whole(0, MOST_POLYNOMIALS, noun="polynomials", remedy=FINER)]
Rotary = Annotated[float, within(0.0, noun="rotary inertia")]
Ratio = Annotated[float, within(0.0, waiver="negative_damping"), PURE]
Factor = Annotated[float, within(0.0, excluded=0.0), PURE]
# Modal coordinates of raw bodies are numbers without unit.
Shapes = Annotated[tuple[Vector, ...], unit("m")]
Turns = Annotated[tuple[Vector, ...], unit("rad")]
SecondShapes = Annotated[VectorSquare, unit("m")]
SecondTurns = Annotated[VectorSquare, unit("rad")]


class SceneStruct(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, metaclass=NamedKeys):
    """Base of all structs of the schema, which are frozen and refuse unknown keys."""


class Node(SceneStruct, frozen=True, kw_only=True):
    """A named frame on a rigid body, in the undeformed body frame.

    Every body also has the implicit node "origin": the body frame itself.
    """

    name: str
    position_m: Vector = ZERO
    quaternion: Quaternion = IDENTITY


class RigidBody(SceneStruct, frozen=True, kw_only=True, tag="rigid", tag_field="kind"):
    """A rigid body: mass, centre of mass in the body frame, inertia about the centre of mass in body axes."""

    name: str
    mass_kg: NotNegative
    com_m: Vector = ZERO
    inertia_kg_m2: Matrix3
    nodes: tuple[Node, ...] = ()

    level: ClassVar[Level] = "rigid"


class BeamStation(SceneStruct, frozen=True, kw_only=True):
    """Section properties at one station; they vary linearly between stations.

    x is the beam axis. A station has its stiffness either by numbers or as a matrix, and so its inertia. By numbers y
    and z are the principal section axes: `EIz` resists bending in the x-y plane. Shear stiffnesses are used by
    Timoshenko beams only; rotary inertias per length are rho*Iy, rho*Iz, and the torsional one is their sum. Where the
    sections of a beam have no inertia about its axis, it twists all the same: the twist has the inertia that they state
    and `points = "line"` leaves out, else that of a homogeneous section, mass per length times (EIy + EIz) / EA.

    `stiffness` (6x6, symmetric, positive definite) maps the strains [extension, shear along y, shear along z, twist,
    curvature about y, curvature about z] to [N, Qy, Qz, Mx, My, Mz]: N where both are forces and strains, N m where one
    is a moment or a curvature, N m² where both are. `inertia` (6x6, symmetric) maps the velocities along and the
    angular velocities about x, y and z to momenta per length: [m 1, -m c~; m c~, J] with the mass m (kg/m), its centre
    c = (0, cy, cz) and the inertia J (kg m) about the reference point. `reference_point_m` (y, z) is where all
    properties of the station are stated, by default on the axis of the beam.

    `curvature_1_m`: twist and curvatures of the unloaded axis about the section's x, y and z, for beams of level
    "exact"; the beam leaves the body's origin along +x.
    """

    x_m: Number
    EA_N: Positive | None = None
    EIy_Nm2: Positive | None = None
    EIz_Nm2: Positive | None = None
    GJ_Nm2: Positive | None = None
    mass_per_length_kg_m: Positive | None = None
    rotary_y_kg_m: Rotary = 0.0
    rotary_z_kg_m: Rotary = 0.0
    GAy_N: Positive | None = None
    GAz_N: Positive | None = None
    curvature_1_m: Vector = ZERO
    stiffness: Annotated[Matrix6, unit("N, N m, N m²")] | None = None
    inertia: Annotated[Matrix6, unit("kg/m, kg, kg m")] | None = None
    reference_point_m: tuple[Number, Number] = (0.0, 0.0)


class TipMass(SceneStruct, frozen=True, kw_only=True):
    """A rigid lump fixed to the beam section at `x_m`; it is part of the body and of its modes."""

    x_m: Number
    mass_kg: Lump
    com_m: Vector = ZERO
    inertia_kg_m2: Matrix3 = (ZERO, ZERO, ZERO)


class BeamNode(SceneStruct, frozen=True, kw_only=True):
    """A named node at station `x_m`. "root" (x = 0) and "tip" (x = length) exist without being listed."""

    name: str
    x_m: Number
    quaternion: Quaternion = IDENTITY


class StrainPolynomials(SceneStruct, frozen=True, kw_only=True):
    """How many polynomials the strains of a beam of level "exact" have along each of its pieces: with 1 a strain is
    constant there, with 2 linear.

    `bending_y` is curvature about the section's z, `bending_z` about y, `axial` the stretch.
    """

    axial: Polynomials = 0
    shear_y: Polynomials = 0
    shear_z: Polynomials = 0
    torsion: Polynomials = 0
    bending_z: Polynomials = 0
    bending_y: Polynomials = 0


class Modes(SceneStruct, frozen=True, kw_only=True):
    """The modes of a beam: the `count` lowest of the chosen families, clamped at the root or free-free.

    `families` are all of them if not given, at level "exact" all but stretch, which makes slender beams stiff.

    `static` adds attachment modes (unit tip force and moment in the chosen families) to the eigenmodes; with `count` 0
    they are the only modes.

    At level "exact" the strains are polynomials along each piece of the beam, and may jump from one to the next, as
    they do at lumps, where the section does, and at nodes with a hinge, a closure, a connector, a load, a wheel or a
    point mass. There the beam is cut by itself, into 8 pieces at most, unless `cuts` or `pieces` are given. `cuts`
    names the nodes where it is cut, beside lumps and steps of the section; `cuts = []` leaves it whole. Each part
    between cuts is divided into `pieces` equal ones. There are `count` polynomials for
    each curvature of the chosen families and for torsion, and two fewer, but one at least, for stretch beside bending
    and, in theory "timoshenko", for the shear of each plane; or as many as `polynomials` says. Attachment modes are
    contained in them. `points`: Gauss points of a piece, three more than the largest number of its polynomials if not
    given, and six at least.

    Damping is that of `damping_ratio` and, if `viscosity_s` is not zero, of a material (Kelvin and Voigt) whose stress
    is that of the strain plus `viscosity_s` times the strain rate.
    """

    count: Annotated[int, whole(0, noun="modes")]
    boundary: Literal["clamped-free", "free-free"] = "clamped-free"
    families: tuple[Family, ...] | None = None
    static: bool = False
    polynomials: StrainPolynomials | None = None
    pieces: Annotated[int, whole(1, MOST_PIECES)] = 1
    cuts: tuple[str, ...] | None = None
    points: Annotated[int, whole(1, MOST_POINTS)] | None = None
    viscosity_s: Damping = 0.0
    damping_ratio: Ratio | tuple[Ratio, ...] = 0.0


class BeamBody(SceneStruct, frozen=True, kw_only=True, tag="beam", tag_field="kind"):
    """A beam along +x of the body frame, root at the origin; straight but for the curvature of its stations.

    `bending_y` is deflection along y (resisted by EIz), `bending_z` along z. `points` is the model of the section's
    inertia: "line" omits it, "rotary" gives each inertia point a tensor that
    turns with it, "section" has four point masses on each section (the kinetic energy is then a polynomial).
    """

    name: str
    length_m: Positive
    elements: Annotated[int, whole(1, remedy="use one element at least")]
    stations: tuple[BeamStation, ...]
    modes: Modes
    level: Level = "full"
    theory: Literal["euler-bernoulli", "timoshenko"] = "euler-bernoulli"
    mass: Literal["consistent", "lumped"] = "consistent"
    points: Literal["line", "rotary", "section"] = "section"
    tip_masses: tuple[TipMass, ...] = ()
    nodes: tuple[BeamNode, ...] = ()

    def __post_init__(self) -> None:
        """A place that rounding has put beside an end of the beam is that end."""
        try:
            near = {
                key: tuple(_at_end(item, self.length_m) for item in getattr(self, key))
                for key in ("stations", "tip_masses", "nodes")
            }
        except (AttributeError, TypeError):  # values of other types, which checks name with their places
            return
        for key, items in near.items():
            if items != getattr(self, key):
                structs.force_setattr(self, key, items)


AtPlace = TypeVar("AtPlace", BeamStation, TipMass, BeamNode)


def _at_end(item: AtPlace, length: float) -> AtPlace:
    """The item itself, or at the end of the beam from which only rounding separates it."""
    if not math.isfinite(length):  # no place is near the ends of such a beam, which checks refuse
        return item
    ends = [end for end in (0.0, length) if item.x_m != end and abs(item.x_m - end) <= ROUNDING * length]
    return structs.replace(item, x_m=ends[0]) if ends else item


class InertiaPoint(SceneStruct, frozen=True, kw_only=True):
    """One inertia point of a raw modal body; docs/notation.md has the equations of the modal field.

    `translation_modes[n]` and `rotation_modes[n]` are the point's displacement and rotation for unit modal
    coordinate n. `com_offset_m` is the mass centre's offset from the point, turning with it. `second_translation[n][k]`
    and `second_rotation[n][k]`, m x m vectors G_nk, add 1/2 sum G_nk eta_n eta_k to displacement and rotation vector at
    level "stiffened"; only their symmetric part has an effect.
    """

    mass_kg: NotNegative
    position_m: Vector
    translation_modes: Shapes
    rotation_modes: Turns = ()
    inertia_kg_m2: Matrix3 = (ZERO, ZERO, ZERO)
    com_offset_m: Vector = ZERO
    second_translation: SecondShapes = ()
    second_rotation: SecondTurns = ()


class ModalNode(SceneStruct, frozen=True, kw_only=True):
    """A node of a raw modal body with its mode shapes.

    For level "stiffened" it also has a second-order field: `second_translation` and `second_rotation` as in an
    InertiaPoint, or `force_stiffness`, the geometric stiffness matrices (m x m) under a unit force at the node along x,
    y and z.
    """

    name: str
    position_m: Vector
    translation_modes: Shapes
    rotation_modes: Turns
    quaternion: Quaternion = IDENTITY
    second_translation: SecondShapes = ()
    second_rotation: SecondTurns = ()
    force_stiffness: Annotated[tuple[Matrix, ...], unit("m")] = ()


class ModalBody(SceneStruct, frozen=True, kw_only=True, tag="modal", tag_field="kind"):
    """Raw points and modes, inline (`points`) or in an `.npz` beside the scene file (`file`).

    The `.npz` has mass (n,), position (n,3), translation_modes (n,3,m), and optionally rotation_modes (n,3,m),
    inertia (n,3,3), com_offset (n,3), stiffness (m,m), damping (m,m).
    `boundary` "clamped-free" asserts that the modes vanish at the body origin.

    Level "stiffened" needs the second-order field of the points: `second_translation` of each point, or in the `.npz`
    second_translation and optionally second_rotation (n,3,m,m). Alternatively, geometric stiffness matrices (m x m)
    are given here or in the `.npz`: `gravity_stiffness[a]` (3,m,m) under the forces mass times unit acceleration along
    axis a on all points, and `gradient_stiffness[a][b]` (3,3,m,m) under mass times the points' coordinate b along axis
    a. The geometric stiffness that a finite-element code computes for spin about z is gradient_stiffness [x][x] +
    [y][y], that for angular acceleration about z is [x][y] - [y][x]. Matrices are positive if the load stiffens.

    `stiffness_factor` multiplies the stiffness matrix, and nothing else: one number for fits, sensitivities and
    uncertainty, by whose square root all frequencies of the held body scale. Damping stays, and so does geometric
    stiffness, which is that of loads.
    """

    name: str
    points: tuple[InertiaPoint, ...] = ()
    file: str | None = None
    stiffness: Annotated[Matrix, unit("N m")] = ()
    stiffness_factor: Factor = 1.0
    damping: Annotated[Matrix, unit("N m s")] = ()
    gravity_stiffness: Annotated[tuple[Matrix, ...], unit("kg m")] = ()
    gradient_stiffness: Annotated[tuple[tuple[Matrix, ...], ...], unit("kg m²")] = ()
    boundary: Literal["clamped-free", "free-free"] = "clamped-free"
    level: Level = "full"
    nodes: tuple[ModalNode, ...] = ()


class SidBody(SceneStruct, frozen=True, kw_only=True, tag="sid", tag_field="kind"):
    """A body from a Standard Input Data file (Wallrapp 1994), which also defines its nodes.

    `compile` converts it to a raw modal body with the same modal integrals. The adapters of other codes refuse it: for
    them, convert the file by `flexmb import`. `stiffness_factor` multiplies the stiffness of the file, as in a raw
    modal body.
    """

    name: str
    file: str
    stiffness_factor: Factor = 1.0
    level: Level = "full"


Body = RigidBody | BeamBody | ModalBody | SidBody
