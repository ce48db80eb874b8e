"""The files of a case folder: the structs of run.toml and provenance.toml.

A case is a folder ``cases/<family>/<case>/`` with ``scene.toml`` (and further scenes), ``run.toml``,
``provenance.toml`` and ``README.md``. Unknown keys are refused with their place. A complete run.toml::

    title = "Pendulum with two arms"
    tags = ["canonical"]
    duration_s = 10.0
    samples = 201

    [[variant]]                       # one model of the physics, run by several engines
    name = "rigid"
    engines = ["native", "pinocchio", "mujoco", "exudyn"]

    [[variant]]
    name = "full"
    scene = "flexible.toml"
    engines = ["native"]
    also = ["native-frisch"]          # charted, and compared where named

    [[variant]]
    name = "segments"
    scene = "flexible.toml"
    transform = "segments"
    segments = 16
    refined = { segments = 32 }       # its distance to the refined model is the discretisation's uncertainty
    engines = ["native", "pinocchio"]

    [[comparison]]                    # every pair of the variant's engines (or of `engines`)
    name = "rigid, all engines"
    variant = "rigid"
    goals = { "marker:tip.position" = 1e-7, "load" = 1e-6, "energy" = 1e-9 }

    [[comparison]]                    # one named pair
    name = "flexible against segments"
    a = { variant = "full", engine = "native" }
    b = { variant = "segments", engine = "pinocchio" }
    goals = { "marker:tip.position" = 1e-2 }
    expect = "differ"
    band = { "marker:tip.position" = [2e-2, 2e-1] }    # E is expected within
    reason = "the unstiffened body bends by more than the beam"

    [[comparison]]
    name = "flexible to the end"
    a = { variant = "full", engine = "native-frisch" }
    b = { variant = "segments", engine = "pinocchio" }
    goals = { "marker:tip.position" = 1e-2 }
    expect = "diverged"
    diverged_s = [7.5, 8.5]           # the last sample time reached is expected within
    reason = "above the critical speed the unstiffened body diverges"

    [[control]]                       # a deliberate fault that must be seen
    name = "upper arm 1 % too heavy"
    mutation = "mass"
    target = "upper"
    a = { variant = "rigid", engine = "native" }       # runs the faulty scene
    b = { variant = "rigid", engine = "pinocchio" }    # runs the true one
    goals = { "marker:tip.position" = 1e-6 }

    [[conservation]]
    variant = "rigid"
    quantity = "energy"
    limit = 1e-9

    [[open]]                          # what is offered and judged by nothing
    variants = ["segments"]
    channels = ["momentum"]
    reason = "it is that of the rods, without the rotors at their middles"

    [[chart]]                         # work-precision chart
    observable = "marker:tip.position"
    variants = ["rigid", "segments"]
    reference = "rigid"

Channels are named ``marker:<name>.position | orientation | velocity | angular_velocity``, ``energy.<kind>``,
``energy.total``, ``momentum.angular | linear``, ``load:<hinge>.torque | force``, ``total_load:<name>.torque | force``,
``wheel_load:<wheel>.torque | force`` and ``drive:<name>``; of the linearised motion, where a variant asks for it,
``derivatives.by_displacement | by_speed | by_force`` and ``frequencies`` (`crosscheck.engines.linear`). A pattern is a
channel, a shell pattern of one (``marker:*.position``), or its beginning (``load``, ``load:elbow``, ``energy``); the
longest that names a channel counts. A goal is the largest uncertainty, relative to the channel's range, with which a
comparison still counts as resolved.

Every channel that an engine of the case offers is named by a goal or a conserved quantity, is in the stored reference
with a goal, or is left ``open`` with the reason, or its run is expected to agree with nothing, for the reason given
there; otherwise a strict session of the case is not green.

An expectation other than *agree* needs its reason in words, and bounds within which it is as expected:
``band`` for E (*differ*) or U (*unresolved*), for each pattern of channels ``[low, high]`` with high at
most 100 times low; ``diverged_s`` for the last sample time that a *diverged* run reached, at most a quarter of the run
wide; ``because`` for a text that the engine's own reason must contain (*failed*, *refused*). What crashed, did not
finish or did not run is never as expected. Statuses are explained in `crosscheck.judging.verdict`.

All keys, with defaults in brackets; the structs below explain them:

- at the top: ``title``; ``tags`` [none]; ``duration_s`` (s); ``samples`` (from 0 to the end, both counted);
  ``intended_use``, ``limits`` and ``waivers`` [not stated], words for its label;
  ``time_limit_s`` [1800] (s), for one engine on one variant with all its efforts; ``--time-limit`` comes before it;
  ``finer`` [0], how many efforts more than its own an engine has that the case does not name, in the ratio of its last
  two: chaotic motion needs finer ones than engines usually have;
- ``variant``: ``name``; ``scene`` ["scene.toml"]; ``transform`` ["none"], or "rigidify", "modal_points", "segments"
  with their number ``segments``, "substructures" with ``pieces`` and ``eigenmodes`` [0], the last two for
  ``split_body`` [every beam] alone; ``level`` [the scene's] of all flexible bodies; ``refined`` [none] with
  ``segments``, ``pieces``, ``elements`` or ``polynomials`` and ``order`` [2.0]; ``engines``; ``also`` [none];
  ``efforts`` [the engine's own], each with ``engine``, ``kind`` ("tolerance" or "step"), ``method`` and falling
  ``values``; ``duration_s`` and ``samples`` [the case's]; ``start`` [the scene's], "equilibrium" near it; ``linear``
  [none], what its engines are asked of the linearised motion at every sample: "derivatives", "frequencies" or both;
  ``rounding`` [false], whether U has what moved inputs do to each engine's result; ``note`` [none], for the report;
- ``comparison``: ``name``; ``variant`` with ``engines`` [all of the variant's], or ``a`` and ``b``, each with a
  ``variant`` and an ``engine``; ``goals``; ``scales`` [the ranges] (SI); ``expect`` ["agree"]; ``band``, ``diverged_s``
  or ``because``, as ``expect`` needs; ``reason``;
- ``control``: ``name``; ``mutation``; ``target`` [the scene]; ``a``; ``b``; ``goals``; ``scales``, as above;
- ``conservation``: ``variant``; ``quantity`` ("energy", "linear_momentum" or "angular_momentum"); ``limit``;
  ``engines`` [the variant's, less ``also``]; ``scale`` [the largest magnitude] (SI); ``expect``, ``band`` (for it all),
  ``diverged_s``, ``because`` and ``reason``, as above;
- ``open``: ``channels``, patterns; ``variants`` [all]; ``engines`` [all of these]; ``reason``;
- ``chart``: ``title`` [the observable's]; ``observable``; ``variants``; ``reference``; ``engines`` [all];
- ``reference``: what ``reference.csv`` holds and how it is made, explained in `crosscheck.library.recipe`.

``library/check`` has the rules: all numbers finite and in their ranges, names unique, patterns of kinds of channels
that exist. Every problem found is reported with its place and the remedy. Beside the run file, ``accepted.toml`` holds
the E and U that each comparison has reached; `crosscheck run --accept` writes it (see `crosscheck.library.accepted`).
"""

from __future__ import annotations

from typing import Literal

import msgspec

from crosscheck.engines.contract import LinearPart
from crosscheck.library.case_error import CaseError
from crosscheck.library.recipe import EffortLadder, ReferenceRecipe
from flexmb.scene.problems import closest
from flexmb.scene.schema import Level

Expectation = Literal["agree", "differ", "unresolved", "refused", "diverged", "failed"]
Band = tuple[float, float]  # the lowest and the highest expected value
Transform = Literal["none", "rigidify", "modal_points", "segments", "substructures"]
TAKES_APART: tuple[Transform, ...] = ("segments", "substructures")
MutationKind = Literal[
    "mass", "inertia", "com", "inertia_swapped", "inertia_products", "inertia_about_origin", "gyroscopic",
    "com_sign", "com_unit", "point_mass", "hinge_axis", "hinge_rotation", "hinge_position", "node_rotation",
    "node_position", "closure_rotation", "closure_position", "coupling_ratio", "coupling_sign", "coupling_offset",
    "gimbal_order", "stiffness", "spring_rest", "damping", "damping_dropped", "armature_dropped", "initial_place",
    "initial_unit", "initial_rate", "initial_speed_sign", "speed_axes", "initial_attitude", "wheel_axis",
    "wheel_momentum", "wheel_inertia", "wheel_inertia_swapped", "wheel_offset", "gravity_sign", "gravity_size",
    "gravity_axis", "gravity_dropped", "load_sign", "load_point", "load_frame", "dropped_stiffening",
    "dropped_deformation", "mode_sign", "mode_order", "mode_rotation", "section_axes", "section_point", "motor_sign",
    "function_size", "function_phase", "connector_stiffness", "connector_rest", "connector_losses", "connector_damping",
    "connector_preload", "connector_one_sided", "connector_stop", "stop_stiffness", "friction_torque",
    "friction_speed", "connector_position", "bushing_rotation", "bushing_ends", "bushing_order", "controller_gain",
    "controller_sign", "controller_dynamics", "controller_limit",
    "controller_setpoint", "controller_period", "controller_offset", "controller_delay", "sensor_frame",
    "sensor_sign", "sensor_component", "event_level", "event_crossing", "event_dropped", "event_hold",
    "event_restitution", "event_value", "event_order",
]  # fmt: skip
Start = Literal["equilibrium"]
Family = Literal["closed_form", "published", "converged", "agreed"]
ReferenceKind = Literal[
    "published", "closed form", "independent codes", "native, two formulations", "high precision"
]  # fmt: skip
FAMILIES: dict[ReferenceKind, Family] = {
    "closed form": "closed_form",
    "published": "published",
    "native, two formulations": "converged",
    "high precision": "converged",
    "independent codes": "agreed",
}
Quantity = Literal["energy", "linear_momentum", "angular_momentum"]


class _CasePart(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of the parts of a run file, which refuses unknown keys."""


class ComparisonSide(_CasePart, frozen=True, kw_only=True):
    """One side of a comparison: a variant run by an engine."""

    variant: str
    engine: str


class Refined(_CasePart, frozen=True, kw_only=True):
    """A finer spatial discretisation of the same variant: more segments, pieces or elements per beam.

    `polynomials` of a beam of level "exact" are so many more of each of its strains. `order` is the convergence order
    of the discretisation's error (2 for finite segments with springs at mid-segment and for pieces of level "full");
    that of polynomials is higher than any, and 2 is then on the safe side.
    """

    segments: int | None = None
    pieces: int | None = None
    elements: int | None = None
    order: float = 2.0
    polynomials: int | None = None

    def __str__(self) -> str:
        """As figures of variants were accepted by it, which had no polynomials at first."""
        return repr(self).replace(", polynomials=None", "")


class Variant(_CasePart, frozen=True, kw_only=True):
    """A model of the case: a scene file, a transformation, and the engines that run the result.

    `transform`: "rigidify" (flexible bodies rigid), "modal_points" (beams as raw points and modes), "segments" (every
    beam, or `split_body` only, as `segments` rigid segments) or "substructures" (likewise as `pieces` flexible pieces
    welded together, each with `eigenmodes` besides its attachment modes). `level` replaces the level of every flexible
    body. `engines` are compared engine by engine; those in `also` run the variant too, for its charts and for what
    names them. `duration_s` and `samples` replace the case's. `start` = "equilibrium" replaces the initial state by the
    equilibrium that flexmb finds from it. `linear` asks for derivatives of accelerations and for
    eigenfrequencies at every sample. `rounding` = true adds to U what rounding does to each engine's result, by two
    more runs with numbers that are moved by 2 units in the last place. `note` is shown in the report.
    """

    name: str
    scene: str = "scene.toml"
    transform: Transform = "none"
    segments: int | None = None
    pieces: int | None = None
    eigenmodes: int = 0
    split_body: str | None = None
    level: Level | None = None
    refined: Refined | None = None
    engines: tuple[str, ...]
    also: tuple[str, ...] = ()
    efforts: tuple[EffortLadder, ...] = ()
    duration_s: float | None = None
    samples: int | None = None
    start: Start | msgspec.UnsetType = msgspec.UNSET  # neither is among the keys of records without it
    linear: tuple[LinearPart, ...] | msgspec.UnsetType = msgspec.UNSET
    rounding: bool | msgspec.UnsetType = msgspec.UNSET
    note: str = ""

    @property
    def moves_inputs(self) -> bool:
        """Whether U has what rounding of the scene's numbers does."""
        return self.rounding is True

    @property
    def asks(self) -> tuple[LinearPart, ...]:
        """What its engines are asked of the linearised motion."""
        return () if isinstance(self.linear, msgspec.UnsetType) else self.linear


class Comparison(_CasePart, frozen=True, kw_only=True):
    """A comparison of two results: `a` and `b`, or every pair of `engines` of one `variant`.

    `goals` maps channel patterns to the resolution goal, relative to the channel's range. `scales` replaces the range
    by an absolute size (SI) for channels whose range is no measure, such as a momentum that stays zero. `band`,
    `diverged_s` and `because` are the bounds of an expectation other than "agree".
    """

    name: str
    variant: str | None = None
    engines: tuple[str, ...] = ()
    a: ComparisonSide | None = None
    b: ComparisonSide | None = None
    goals: dict[str, float]
    scales: dict[str, float] = {}
    expect: Expectation = "agree"
    band: dict[str, Band] = {}
    diverged_s: Band | None = None
    because: str = ""
    reason: str = ""

    @property
    def sides(self) -> tuple[ComparisonSide, ComparisonSide]:
        """Both sides of a comparison of one pair, as `selection.select` returns it."""
        assert self.a is not None and self.b is not None
        return self.a, self.b


class Control(_CasePart, frozen=True, kw_only=True):
    """A negative control: `a` runs the scene with a deliberate fault, `b` the true one; the verdict must be *differ*.

    The mutations are in `crosscheck.library.mutations` and docs/mutations.md. For
    example "mass" (+1 % of body `target`), "hinge_axis" (sign of hinge `target`), "node_rotation" (conjugated
    quaternion of "body.node" `target`), "gravity_sign" of the scene.
    """

    name: str
    mutation: MutationKind
    target: str = ""
    a: ComparisonSide
    b: ComparisonSide
    goals: dict[str, float]
    scales: dict[str, float] = {}

    @property
    def sides(self) -> tuple[ComparisonSide, ComparisonSide]:
        """The faulty side, and the true one."""
        return self.a, self.b


class Conservation(_CasePart, frozen=True, kw_only=True):
    """A conserved quantity: its drift over the run, less the recorded work, relative to `scale`, is at most `limit`.

    `scale` (SI) is by default the largest magnitude reached: for the energy the largest sum of magnitudes of its kinds.
    `engines` are by default all of the variant's. Bounds of an expectation are those of a comparison, with one `band`.
    """

    variant: str
    quantity: Quantity
    limit: float
    engines: tuple[str, ...] = ()
    scale: float | None = None
    expect: Expectation = "agree"
    band: Band | None = None
    diverged_s: Band | None = None
    because: str = ""
    reason: str = ""


class OpenChannels(_CasePart, frozen=True, kw_only=True):
    """Channels, by patterns, of some `variants` and `engines` (by default all) that nothing judges, and why not.

    It concerns engines that the case names. What an engine that joins offers there is held against others all the same.
    """

    channels: tuple[str, ...]
    variants: tuple[str, ...] = ()
    engines: tuple[str, ...] = ()
    reason: str

    def concerns(self, variant: str, engine: str) -> bool:
        """Whether it is about an engine's run of a variant."""
        return variant in (self.variants or (variant,)) and engine in (self.engines or (engine,))


class Chart(_CasePart, frozen=True, kw_only=True):
    """A work-precision chart: error of `observable` against the most certain result of variant `reference`.

    `engines`, by default all, are those that are shown: a chart of one engine's models shows what a scene needs.
    """

    title: str = ""
    observable: str
    variants: tuple[str, ...]
    reference: str
    engines: tuple[str, ...] = ()

    def shows(self, variant: str, engine: str) -> bool:
        """Whether the runs of an engine on a variant are in it."""
        return variant in self.variants and engine in (self.engines or (engine,))


class RunFile(_CasePart, frozen=True, kw_only=True):
    """run.toml. `time_limit_s` is how long one engine may take for one variant, all its efforts together.

    `finer` is how many efforts more than its own an engine has that joins by `--engine`. `intended_use`, `limits` of it
    and `waivers` of what the use would require are words for the case's label (`crosscheck.label`), and move no level.
    """

    title: str
    tags: tuple[str, ...] = ()
    intended_use: str = ""
    limits: tuple[str, ...] = ()
    waivers: tuple[str, ...] = ()
    duration_s: float
    samples: int
    time_limit_s: float | None = None
    finer: int = 0
    variants: tuple[Variant, ...] = msgspec.field(name="variant")
    comparisons: tuple[Comparison, ...] = msgspec.field(name="comparison", default=())
    controls: tuple[Control, ...] = msgspec.field(name="control", default=())
    conservations: tuple[Conservation, ...] = msgspec.field(name="conservation", default=())
    open: tuple[OpenChannels, ...] = ()
    charts: tuple[Chart, ...] = msgspec.field(name="chart", default=())
    reference: ReferenceRecipe | None = None

    def alone(self, *variants: Variant) -> RunFile:
        """The run file with these variants only, and with nothing that is judged or drawn."""
        return msgspec.structs.replace(
            self, variants=variants, comparisons=(), controls=(), conservations=(), charts=(), reference=None
        )

    def variant(self, name: str) -> Variant:
        """The variant called `name`; CaseError says which is the nearest."""
        for variant in self.variants:
            if variant.name == name:
                return variant
        raise CaseError(f'no variant "{name}": {closest(name, (variant.name for variant in self.variants))}')


class PublishedNumber(_CasePart, frozen=True, kw_only=True):
    """A published number: `value` (SI) of a component of a channel at time `t_s`, with its `uncertainty` (SI).

    `component` is "x", "y", "z", for orientations also "w", "" where the channel has only one.
    """

    channel: str
    component: str = ""
    t_s: float
    value: float
    uncertainty: float
    source: str


class Provenance(_CasePart, frozen=True, kw_only=True):
    """provenance.toml: the origin of the case's data and of its expected outcome.

    `reference` is the kind of the case's reference: a published number; a closed form; the agreement of independent
    codes; or two formulations of this library alone, integrated by two methods ("high precision" is another word for
    the last). What the routes that are stored say comes first: `crosscheck.library.basis` finds a word that does not
    follow from them. `uncertainty` states, in words and numbers, how well it is known.
    `anchors` are published numbers that the reference must meet.
    """

    reference: ReferenceKind
    sources: tuple[str, ...]
    uncertainty: str
    notes: str = ""
    anchors: tuple[PublishedNumber, ...] = msgspec.field(name="anchor", default=())

    @property
    def family(self) -> Family:
        """The family of references to which it belongs."""
        return FAMILIES[self.reference]
