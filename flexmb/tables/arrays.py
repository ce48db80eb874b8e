"""The arrays of kernels: names, shapes and units.

N bodies (point masses included, as bodies without rotary inertia), numbered base to tip; P ports; S summed points;
W wheels; L loads; C connectors between two ports; F functions of time; m the largest number of modes, rounded up to
whole strips (`flexmb.jit.strips`): entries beyond the modes of a body are zero; nq, nu lengths of q and u. All data of
a body are in its frame: the outboard hinge frame O if the modes do not move O in the body, else the modal frame.
Angular components come first. Units are SI. Most tables are arrays of records, so that code reads like
``c.body[k].parent``.

A *port* is a frame fixed to a point of a body that may deform: where a hinge, wheel, load or marker sits.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexmb.jit.bundle import bundle
from flexmb.tables import features
from flexmb.typing import Index, Real, Record

EXPLICIT, WOODBURY, CONDENSED = range(3)
ANGULAR_Z, LINEAR_Z, NO_AXIS = 2, 5, -1
FORCE, TORQUE = range(2)
WORLD_AXES, NODE_AXES = range(2)
BOTH, TENSION, COMPRESSION = range(3)
ON_GROUND = -1  # body of an end that is fixed in World

_F, _I = np.float64, np.int64


def _record(*fields: tuple) -> np.dtype:
    return np.dtype(list(fields), align=True)


BODY = _record(  # the fields that rigid bodies use come first, so that they share cache lines
    ("placement_position", _F, (3,)),  # O+ in the parent's frame
    ("placement_rotation", _F, (9,)),  # R_parent_O+
    # mass, first moment (3), inertia about the origin (xx yy zz xy xz yz) at rest; levels full and linear:
    # without the summed points
    ("rigid", _F, (10,)),
    ("parent", _I),  # -1 for ground
    # whether this body is the first in the inward sweep to add to its parent's inertia, and also adds the parent's own
    ("starts", _I),
    ("started", _I),  # whether an outboard body `starts` its inertia: for level rigid, without wheels
    ("axis", _I),  # of a hinge with one speed, along z: its row of a motion, ANGULAR_Z or LINEAR_Z; NO_AXIS for others
    ("q_index", _I),  # first hinge coordinate in q
    ("u_index", _I),  # first hinge speed in u
    ("hinge_kind", _I),  # numbers of flexmb.hinges.catalogue
    ("level", _I),  # numbers of flexmb.levels.body
    ("nv", _I),  # number of hinge speeds
    ("quaternion", _I),  # where the quaternion of its hinge begins in q, -1 where there is none
    ("sequence", _I, (3,)),  # axis numbers of a gimbal
    ("ball_spring", _F),  # stiffness of a spherical hinge
    ("modes", _I),  # number of modes
    ("elimination", _I),  # of the modes: EXPLICIT, WOODBURY or CONDENSED
    ("reduced", _I),  # row of the tables of ReducedConstants, where not EXPLICIT
    ("node", _I),  # place of the inboard port among its parent's nodes, where the parent's elimination is not EXPLICIT
    ("nodes", _I),  # number of such places: hinges of outboard bodies at ports that deform
    ("orthogonal", _I),  # whether the modal masses are diagonal
    ("uncoupled", _I),  # whether modal stiffness and modal damping are diagonal
    ("eta_index", _I),  # first modal coordinate in q
    ("etad_index", _I),  # first modal speed in u
    ("inboard_port", _I),  # port of the inboard hinge frame O+ on the parent; -1: `placement` holds it, undeforming
    ("outboard_port", _I),  # port of the outboard hinge frame O on the body; -1: O is the body frame
    ("product", _I),  # level full: row of `product`
    ("slope", _I),  # level linear: row of `slope`
    ("mass_slope", _I),  # level linear: row of `mass_slope`; -1 where the modal masses do not change
    ("point_start", _I),
    ("point_stop", _I),
    ("port_start", _I),
    ("port_stop", _I),
    ("wheel_start", _I),
    ("wheel_stop", _I),
    ("load_start", _I),
    ("load_stop", _I),
    ("section_start", _I),  # level exact: its sections
    ("section_stop", _I),
    ("gauss_points", _I),  # number of Gauss points among them
    ("planar", _I),  # whether all sections turn about one axis
    ("stretching", _I),  # whether the modes stretch or shear the beam
    ("bending_axis", _F, (3,)),  # that axis, unit, body axes
    ("parameters", _F, (3,)),  # real numbers of its hinge, such as the pitch of a screw (m/rad)
)
SLOPE = _record(  # level linear: mode n of a body by eta_k
    ("mfr", _F, (6,)),  # d mfr_n / deta_k = [C1_kn; L1_kn]
    ("coriolis", _F, (3,)),  # C1_kn - C1_nk, velocity-dependent force w . coriolis etad_k on the mode
    ("gyration", _F, (6,)),  # symmetric G_nk = 1/2 d2J/(deta_n deta_k)
)
# Points summed at every evaluation: turning inertia, offset mass centres; level linear: wheels; stiffened: all.
POINT = _record(
    ("mass", _F),  # 0 if the mass is in the polynomial part or in another point
    ("position", _F, (3,)),
    ("offset", _F, (3,)),  # mass centre from the point, in point axes
    ("inertia", _F, (6,)),  # about the mass centre
    ("turning", _I),  # whether it has an inertia or an offset
    ("second", _I),  # level stiffened: row of `second_shape`, else -1
    ("section", _I),  # level exact: the section that it is fixed to, else -1
)
PORT = _record(
    ("position", _F, (3,)),
    ("offset", _F, (3,)),  # in node axes (parallel to the body's at rest)
    ("frame", _F, (9,)),  # rotation port -> node axes
    ("second", _I),  # level stiffened: row of `second_shape`, else -1
    ("section", _I),  # level exact: the section that it is fixed to, else -1
)
# Level exact: sections of beams, whose motion follows one from the other, see `flexmb.modal.strain_field`.
SECTION = _record(
    ("before", _I),  # the section from which it is turned, -1 for the root
    ("gauss", _I),  # its number among the Gauss points of its body, -1 for others
    ("base", _I),  # the section at the inboard end of its interval, -1 for the root
    ("own_start", _I),  # the first of the Gauss points of its interval
    ("own_stop", _I),
    ("arm", _F, (3,)),  # from its base, at rest
    ("tangent", _F, (3,)),  # of the axis at rest
)
SHAPE = _record(("translation", _F, (3,)), ("rotation", _F, (3,)))  # of second order, at a port or point
WHEEL = _record(
    ("port", _I),
    ("q_index", _I),
    ("u_index", _I),
    ("axis", _F, (3,)),  # unit, in port axes
    ("mass", _F),
    ("axial", _F),
    ("transverse", _F),
)
LOAD = _record(
    ("port", _I),
    ("type", _I),  # FORCE or TORQUE
    ("frame", _I),  # WORLD_AXES or NODE_AXES
    ("function", _I),
    ("direction", _F, (3,)),
)
CONNECTOR = _record(
    ("kind", _I),  # numbers of laws between frames, flexmb.connectors.catalogue
    ("acts", _I),  # BOTH, TENSION or COMPRESSION
    ("function", _I),  # of the actuator, -1 for none
    ("start", _I),  # its rows of `law`
    ("stop", _I),
    ("row", _I),  # of `frame_law`, -1 for a law without parameters
    ("free_length", _F),
    ("smoothing", _F),  # length s in sqrt(d.d + s^2), see flexmb.connectors.line
    ("damping", _F),
)
END = _record(
    ("body", _I),  # ON_GROUND for an end there
    ("port", _I),
    ("position", _F, (3,)),  # World, on the ground only
    ("rotation", _F, (9,)),  # R_World_port, on the ground only
)
FRAME_LAW = _record(("parameters", _F, (72,)))  # the law's own numbers
HINGE_SPRING = _record(
    ("speed", _I),  # of the coordinate, place in u
    ("start", _I),  # its rows of `law`
    ("stop", _I),
    ("rest", _F),
    ("damping", _F),
    ("lower", _F),  # stops; beyond all coordinates if there is none
    ("upper", _F),
    ("stop_stiffness", _F),
    ("stop_dissipation", _F),
    ("function", _I),  # of the actuator, -1 for none
)
COORDINATE_LAW = _record(
    ("kind", _I),  # numbers of laws along coordinates, flexmb.connectors.catalogue
    ("speed", _I),  # of the coordinate, place in u
    ("parameters", _F, (6,)),  # the law's own numbers
)
SPEED = _record(
    ("coordinate", _I),  # its scalar coordinate's place in q; -1 for speeds of a quaternion or of a mode
    ("motor", _I),  # function, -1 for none
    ("prescribed", _I),  # function of the coordinate's value, -1 where it is free
    ("stiffness", _F),
    ("damping", _F),
    ("rest", _F),
    ("armature", _F),  # inertia along the speed alone, beside that of the bodies
    ("doubtful", _F),  # pivots below this, relative to all that the speed moves, may be rounding errors
)
FUNCTION = _record(
    ("kind", _I),
    ("data", _F, (4,)),
    ("start", _I),  # its rows of `table`
    ("stop", _I),
)


@bundle
class Constants:
    """The arrays that do not change in a run."""

    gravity: Real  # (3,) World axes, m/s^2
    body: Record  # (N,) BODY
    mff: Real  # (N,m,m) modal mass matrix at rest, less that of summed points
    mfr: Real  # (N,6,m) coupling to [angular; linear] at rest
    gyration: Real  # (N,6,m) ruthless, linear: B_n = -1/2 dJ/deta_n, centrifugal force w' B_n w on the mode
    stiffness: Real  # (N,m,m)
    damping: Real  # (N,m,m)
    product: Real  # (bodies of level full,strips of m,1+m,72) as `flexmb.levels.affine_integrals` has it
    moves: Real  # (the same bodies,m,3) 1 where a mode moves masses along an axis, else 0
    slope: Record  # (bodies of level linear,m,m) SLOPE
    mass_slope: Real  # (those of them whose modal masses change,m,m,m) [n,i,k] d mff_ni / deta_k
    point: Record  # (S,) POINT
    point_mode: Real  # (S,6,m) mode shapes [rotation; translation]
    port: Record  # (P,) PORT
    port_mode: Real  # (P,6,m) mode shapes [rotation; translation]
    second_shape: Record  # (their ports and summed points,m,m) SHAPE: the second-order field G_ni
    section: Record  # (sections,) SECTION
    # (sections,12,m) three integrals of the elastic curvature over the interval, stretch and shears at the section; of
    # bodies that bend about one axis the first row is the angle
    section_rows: Real
    section_weight: Real  # (sections,most own Gauss points) integrals from the base of Lagrange's polynomials
    wheel: Record  # (W,) WHEEL
    load: Record  # (L,) LOAD
    connector: Record  # (C,) CONNECTOR
    end: Record  # (C,2) END, A then B
    frame_law: Record  # (connectors whose laws have parameters,) FRAME_LAW
    hinge_spring: Record  # (springs along coordinates,) HINGE_SPRING
    coordinate_law: Record  # (laws along coordinates that are no springs,) COORDINATE_LAW
    # (pieces,8) of load laws: left end, energy there, then coefficients, highest power first; the first piece of a law
    # also applies below its left end
    law: Real
    speed: Record  # (nu,) SPEED
    function: Record  # (F,) FUNCTION
    table: Real  # (T,8) pieces of functions of time, see `flexmb.tables.pieces`
    kernels: Index  # (1,) which kernels run this scene: see `flexmb.tables.features`

    def features(self) -> frozenset[str]:
        """The features that kernels for these constants contain."""
        return features.features(self)

    def fastest(self, what: str) -> Constants:
        """The same for the fastest kernels that are at hand for RECURSION and others of `flexmb.tables.features`."""
        kernels = features.fastest_at_hand(self, what)
        return self if kernels == self.kernels[0] else replace(self, kernels=np.array([kernels]))


# Each reduced body has nodes i = 0..C-1, at which outboard bodies are hinged; their vectors are stacked (6C).
REDUCED_NODE = _record(
    ("port", _I),
    # Theta = phi' - Pi Lam M_fr: acceleration of the node at unit acceleration of the body, without forces on the modes
    ("theta", _F, (6, 6)),
)


@bundle
class ReducedConstants(Constants):
    """Constants of a scene with reduced bodies, whose D_f is not factorised (Appendix B of Jain & Rodriguez).

    R reduced bodies; C the largest number of nodes of one. M_ff = L L', Lam = M_ff^-1.
    """

    compliance: Real  # (R,m,m) condensed: L^-1; Woodbury: Lam
    # (R,1+C,m,8) at rest, six of each row: Psi = Lam M_fr, then Ups_1 .. Ups_C of Ups = Lam Pi'; condensed: L' times it
    gain: Real
    node: Record  # (R,C) REDUCED_NODE at rest
    root: Real  # (R,6C,6C) at rest: Omega = Pi Lam Pi' = root' root
    rank: Index  # (R,) rows of root
    zeta: Real  # (R,21) at rest: M_rf Lam M_fr, as a spatial inertia


BODY_STATE = _record(  # the fields that every evaluation writes come first, so that they share cache lines
    ("rotation", _F, (9,)),  # R_parent_body
    ("arm", _F, (3,)),  # from the parent's reference (port or origin) to O, parent axes
    ("velocity", _F, (6,)),  # of the body frame, body axes
    ("bias", _F, (6,)),  # acceleration of O at zero udot and parent at rest, body axes
    ("inertia", _F, (21,)),  # rigid block of the articulated inertia about the body origin
    ("force", _F, (6,)),  # rigid part of the bias force
    # for a hinge with a single axis, see flexmb.jain.hinge_solve:
    ("gain", _F, (6,)),  # G
    ("inertia_along", _F),  # D_R
    ("rate_at_rest", _F),  # D_R^-1 epsilon_R
    ("free_count", _I),
    ("accel", _F, (6,)),  # of the body frame, minus gravity, body axes
    ("accel_hinge", _F, (6,)),  # of O without modal accelerations; not written in scenes where O is always the origin
    ("hinge_inertia", _F, (21,)),  # P_R about O
    ("hinge_force", _F, (6,)),  # z_R about O (without P_R a)
    ("pose_rotation", _F, (9,)),  # R_World_body
    ("pose_position", _F, (3,)),
    ("load", _F, (6,)),  # load across the hinge on the body about O, body axes
)
HINGE_STATE = _record(  # by free speed
    ("map", _F, (6, 6)),  # H in outboard axes; columns 0..nv-1
    ("motion", _F, (6, 6)),  # H in body axes, where O deforms relative to the body
    ("gain", _F, (6, 6)),  # L^-1 (P_R H)'
    ("factor", _F, (6, 6)),  # Cholesky factor L of D_R
    ("residual", _F, (6,)),  # L^-1 epsilon_R
    ("free_speed", _I, (6,)),  # the hinge's speeds that are free
)
PORT_STATE = _record(
    ("r", _F, (3,)),  # position from the body origin
    ("R", _F, (9,)),  # R_body_port
    ("v", _F, (6,)),  # velocity relative to the body
    ("a", _F, (6,)),  # acceleration relative to the body at etaddot = 0
)
SECTION_STATE = _record(  # relative to the body, body axes
    ("r", _F, (3,)),  # position from the body origin
    ("R", _F, (9,)),  # rotation from the position at rest
    ("omega", _F, (3,)),
    ("alpha", _F, (3,)),  # accelerations at etaddot = 0
    ("v", _F, (3,)),
    ("a", _F, (3,)),
)
TANGENT_STATE = _record(  # of the axis, at a Gauss point
    ("change", _F, (3,)),  # since rest
    ("acceleration", _F, (3,)),  # at etaddot = 0
)
CONNECTOR_STATE = _record(
    ("load", _F, (6,)),  # [torque; force] on B about B, World axes
    ("arm", _F, (3,)),  # from A to B, World axes
    ("upright", _F),  # square of the cosine of half the rotation, where a law limits it
    ("energy", _F),
    ("power", _F),  # of all non-elastic forces
)
ALONG_HINGE_STATE = _record(
    ("load", _F),  # along the coordinate
    ("energy", _F),
    ("power", _F),  # of all non-elastic forces
)
SPEED_STATE = _record(
    ("acceleration", _F),  # udot
    ("applied", _F),  # spring + damper + motor
    ("drive", _F),  # drive load of a prescribed coordinate, beyond springs and motors
)


@bundle
class Workspace:
    """The arrays that one evaluation writes. One workspace per thread."""

    q: Real  # (nq,) quaternions normalised, prescribed coordinates exact
    u: Real  # (nu,)
    raw: Real  # (nq,) coordinates as the integrator has them
    rate: Real  # (nq,) qdot
    ground: Real  # (3,) acceleration of the ground, World axes: -gravity
    angle: Real  # (N,) of hinges with a single axis of rotation; the three have N rounded up to a multiple of LANES,
    sine: Real  # (N,) because sines and cosines are computed for LANES angles at once
    cosine: Real  # (N,)
    body: Record  # (N,) BODY_STATE
    hinge: Record  # (N,) HINGE_STATE; not touched where every hinge has a single axis
    eta: Real  # (N,m) modal coordinates in the inertia terms: 0 at level ruthless
    etad: Real  # (N,m)
    etadd: Real  # (N,m)
    # modal blocks of the articulated inertia and bias force, then their factors (`flexmb.jain.explicit`)
    pff: Real  # (N,m,m); the inward sweep uses its upper triangle only
    pfr: Real  # (N,m,8) coupling to [angular; linear], and two more columns, see `flexmb.jain.explicit`
    zf: Real  # (N,m)
    inverse_pivot: Real  # (N,m)
    port: Record  # (P,) PORT_STATE
    port_mode: Real  # (P,6,m) [angular; linear] velocity per modal speed
    point_mode: Real  # (6,m or 8) likewise of one summed point; scratch, at least one strip long
    section: Record  # (sections,) SECTION_STATE
    section_mode: Real  # (sections,6,m) [angular; linear] velocity per modal speed
    tangent: Record  # (Gauss points of one body,) TANGENT_STATE; scratch
    tangent_mode: Real  # (the same,3,m) rate of the tangent per modal speed; scratch
    speed: Record  # (nu,) SPEED_STATE
    connector: Record  # (C,) CONNECTOR_STATE
    hinge_spring: Record  # ALONG_HINGE_STATE
    coordinate_law: Record  # ALONG_HINGE_STATE
    function: Real  # (F,3) value, rate, acceleration
    fault: Index  # (1,) body at which an evaluation failed
    doubt: Index  # (1,) whether an evaluation met a pivot that may consist of rounding errors
    displaced: Index  # (1,) whether ruthless bodies may be deformed in this workspace, see `velocity_sweep`


NODE_STATE = _record(  # node of a reduced body, axes of the body
    ("gamma", _F, (21,)),  # P_R^+ of the outboard body about the node: Gamma
    ("force", _F, (6,)),  # y = z_R^+ of the outboard body about the node, then F_0
    ("theta", _F, (6, 6)),
    ("carried", _F, (6, 6)),  # T Theta: force at the node per acceleration of the body
    ("response", _F, (6,)),  # Ups' z_f + Omega y, then the force F at the node
)


@bundle
class ReducedWorkspace(Workspace):
    """The workspace of a scene with reduced bodies, with the tables at rest as initial values."""

    gain: Real  # (R,1+C,m,8)
    node: Record  # (R,C) NODE_STATE
    root: Real  # (R,6C,6C)
    rank: Index  # (R,)
    zeta: Real  # (R,21)
    scratch: Real  # (3,6C,6C): B = C^-1 root Gamma; C C' = 1 + root Gamma root'; T = Gamma - B'B
