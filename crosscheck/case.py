"""What a case folder says: the structs behind run.toml and provenance.toml, and the rules they must satisfy.

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

    [[chart]]                         # work-precision chart
    observable = "marker:tip.position"
    variants = ["rigid", "segments"]
    reference = "rigid"

Channels are named ``marker:<name>.position | orientation | velocity | angular_velocity``, ``energy.<kind>``,
``energy.total``, ``momentum.angular | linear``, ``load:<hinge>.torque | force``,
``wheel_load:<wheel>.torque | force`` and ``drive:<name>``. A pattern is a channel, a shell pattern of one
(``marker:*.position``), or its beginning (``load``, ``load:elbow``, ``energy``). A goal is the largest uncertainty,
relative to the channel's range, with which a comparison still counts as resolved.
"""

from __future__ import annotations

import math
from typing import Literal

import msgspec

from flexmb.scene.schema import Level

Expectation = Literal["agree", "differ", "unresolved", "refused", "failed"]
Transform = Literal["none", "rigidify", "modal_points", "segments", "substructures"]
TAKES_APART: tuple[Transform, ...] = ("segments", "substructures")
MutationKind = Literal[
    "mass",
    "inertia",
    "com",
    "hinge_axis",
    "hinge_rotation",
    "node_rotation",
    "gravity_sign",
    "wheel_axis",
    "stiffness",
    "dropped_stiffening",
]
Quantity = Literal["energy", "linear_momentum", "angular_momentum"]


class CaseError(ValueError):
    """A case folder that cannot be run: the message names the file, the place in it and the remedy."""


class _Strict(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Refuses unknown keys; frozen."""


class Side(_Strict, frozen=True, kw_only=True):
    """One side of a comparison: a variant run by an engine."""

    variant: str
    engine: str


class Refined(_Strict, frozen=True, kw_only=True):
    """A finer spatial discretisation of the same variant: more segments, pieces or elements per beam.

    `order` is the convergence order of the discretisation's error (2 for finite segments with springs at mid-segment
    and for pieces of level "full").
    """

    segments: int | None = None
    pieces: int | None = None
    elements: int | None = None
    order: float = 2.0


class EffortLadder(_Strict, frozen=True, kw_only=True):
    """Efforts that replace an engine's own ladder for a variant: `values` from coarse to fine, at least two."""

    engine: str
    kind: Literal["tolerance", "step"]
    method: str
    values: tuple[float, ...]


class Variant(_Strict, frozen=True, kw_only=True):
    """A model of the case: a scene file, a transformation, and the engines that run the result.

    `transform`: "rigidify" (flexible bodies rigid), "modal_points" (beams as raw points and modes), "segments" (every
    beam, or `split_body` only, as `segments` rigid segments) or "substructures" (likewise as `pieces` flexible pieces
    welded together, each with `eigenmodes` besides its attachment modes). `level` replaces the level of every flexible
    body. `engines` are compared engine by engine; those in `also` run the variant too, for its charts and for what
    names them. `duration_s` and `samples` replace the case's. `note` is shown in the report.
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
    note: str = ""


class Comparison(_Strict, frozen=True, kw_only=True):
    """Two results held against each other: `a` and `b`, or every pair of `engines` of one `variant`.

    `goals` maps channel patterns to the resolution goal, relative to the channel's range. `scales` replaces the range
    by an absolute size (SI) for channels whose range is no measure, such as a momentum that stays zero.
    """

    name: str
    variant: str | None = None
    engines: tuple[str, ...] = ()
    a: Side | None = None
    b: Side | None = None
    goals: dict[str, float]
    scales: dict[str, float] = {}
    expect: Expectation = "agree"
    reason: str = ""


class Control(_Strict, frozen=True, kw_only=True):
    """A negative control: `a` runs the scene with a deliberate fault, `b` the true one; they must come out *differ*.

    Mutations: "mass" and "inertia" (+1 % of body `target`), "com" (+1 % of the body's mass-centre offset),
    "hinge_axis" (sign of hinge `target`), "hinge_rotation" and "node_rotation" (conjugated quaternion of hinge or
    "body.node" `target`), "gravity_sign", "wheel_axis" (sign of wheel `target`), "stiffness" (+1 % of the springs of
    hinge or of body `target`), "dropped_stiffening" (level stiffened becomes full).
    """

    name: str
    mutation: MutationKind
    target: str = ""
    a: Side
    b: Side
    goals: dict[str, float]
    scales: dict[str, float] = {}


class Conservation(_Strict, frozen=True, kw_only=True):
    """A conserved quantity: its drift over the run, less the recorded work, relative to `scale`, is at most `limit`.

    `scale` (SI) is by default the largest magnitude reached: for the energy the largest sum of magnitudes of its kinds.
    `engines` are by default all of the variant's.
    """

    variant: str
    quantity: Quantity
    limit: float
    engines: tuple[str, ...] = ()
    scale: float | None = None
    expect: Expectation = "agree"
    reason: str = ""


class Chart(_Strict, frozen=True, kw_only=True):
    """A work-precision chart: error of `observable` against the most certain result of variant `reference`."""

    title: str = ""
    observable: str
    variants: tuple[str, ...]
    reference: str


class RunFile(_Strict, frozen=True, kw_only=True):
    """run.toml. `time_limit_s` is how long one engine may take for one variant, all its efforts together."""

    title: str
    tags: tuple[str, ...] = ()
    duration_s: float
    samples: int
    time_limit_s: float | None = None
    variants: tuple[Variant, ...] = msgspec.field(name="variant")
    comparisons: tuple[Comparison, ...] = msgspec.field(name="comparison", default=())
    controls: tuple[Control, ...] = msgspec.field(name="control", default=())
    conservations: tuple[Conservation, ...] = msgspec.field(name="conservation", default=())
    charts: tuple[Chart, ...] = msgspec.field(name="chart", default=())

    def variant(self, name: str) -> Variant:
        """The variant called `name`; CaseError names those there are."""
        for variant in self.variants:
            if variant.name == name:
                return variant
        known = ", ".join(variant.name for variant in self.variants)
        raise CaseError(f'no variant "{name}"; the variants are {known}')


class Provenance(_Strict, frozen=True, kw_only=True):
    """provenance.toml: where the case's data and its expected outcome come from.

    `reference` says what anchors the case: a published number, a closed form, or the agreement of independent codes.
    `uncertainty` states, in words and numbers, how well that anchor is known.
    """

    reference: Literal["published", "closed form", "high precision", "independent codes"]
    sources: tuple[str, ...]
    uncertainty: str
    notes: str = ""


def check_run_file(run: RunFile) -> None:
    """Refuse references to variants and engines that do not exist, empty comparisons and unexplained expectations."""
    names = [variant.name for variant in run.variants]
    _require(len(set(names)) == len(names), "variant", "two variants have the same name")
    _require(run.duration_s > 0 and run.samples >= 2, "duration_s", "a run needs a duration and at least 2 samples")
    limit = run.time_limit_s
    _require(limit is None or 0.0 < limit < math.inf, "time_limit_s", "a time limit is a positive number of seconds")
    for i, variant in enumerate(run.variants):
        _check_variant(variant, f"variant[{i}]")
    for i, comparison in enumerate(run.comparisons):
        _check_comparison(run, comparison, f"comparison[{i}]")
    for i, control in enumerate(run.controls):
        where = f"control[{i}]"
        _check_side(run, control.a, f"{where}.a")
        _check_side(run, control.b, f"{where}.b")
        _require(bool(control.goals), f"{where}.goals", "name at least one channel and its goal")
    for i, conservation in enumerate(run.conservations):
        where = f"conservation[{i}]"
        variant = run.variant(conservation.variant)
        _check_engines(variant, conservation.engines, where)
        explained = conservation.expect == "agree" or bool(conservation.reason)
        _require(explained, f"{where}.reason", "an expected status needs a reason")
    for i, chart in enumerate(run.charts):
        for name in (*chart.variants, chart.reference):
            _require(name in names, f"chart[{i}]", f'no variant "{name}"; the variants are {", ".join(names)}')


def _check_variant(variant: Variant, where: str) -> None:
    _require(bool(variant.engines), f"{where}.engines", "name at least one engine")
    twice = set(variant.engines) & set(variant.also)
    _require(not twice, f"{where}.also", f"{', '.join(sorted(twice))} is among the engines already")
    for key, transform in (("segments", "segments"), ("pieces", "substructures")):
        given = getattr(variant, key) is not None
        _require(given == (variant.transform == transform), f"{where}.{key}", f'give it exactly with "{transform}"')
        finer = variant.refined is not None and getattr(variant.refined, key) is not None
        _require(given or not finer, f"{where}.refined.{key}", f'give it with "{transform}" only')
    pieces = variant.transform == "substructures"
    _require(pieces or not variant.eigenmodes, f"{where}.eigenmodes", 'give it with "substructures" only')
    split = variant.transform in ("segments", "substructures")
    _require(split or variant.split_body is None, f"{where}.split_body", 'give it with "segments" or "substructures"')
    for i, ladder in enumerate(variant.efforts):
        _require(len(ladder.values) >= 2, f"{where}.efforts[{i}].values", "an uncertainty needs at least two efforts")
        falling = all(a > b for a, b in zip(ladder.values, ladder.values[1:], strict=False))
        _require(falling, f"{where}.efforts[{i}].values", "list them from coarse to fine (falling)")


def _check_comparison(run: RunFile, comparison: Comparison, where: str) -> None:
    _require(bool(comparison.goals), f"{where}.goals", "name at least one channel and its goal")
    explained = comparison.expect == "agree" or bool(comparison.reason)
    _require(explained, f"{where}.reason", "an expected status needs a reason")
    if comparison.variant is not None:
        _require(comparison.a is None and comparison.b is None, where, "give either variant, or a and b")
        _check_engines(run.variant(comparison.variant), comparison.engines, where)
        return
    _require(not comparison.engines, f"{where}.engines", "engines belongs to variant; a and b name theirs")
    for key, side in (("a", comparison.a), ("b", comparison.b)):
        if side is None:
            raise CaseError(f"$.{where}: give either variant, or a and b")
        _check_side(run, side, f"{where}.{key}")


def _check_side(run: RunFile, side: Side, where: str) -> None:
    _check_engines(run.variant(side.variant), (side.engine,), where)


def _check_engines(variant: Variant, engines: tuple[str, ...], where: str) -> None:
    for engine in engines:
        message = f'engine "{engine}" does not run variant "{variant.name}": add it to the variant\'s engines'
        _require(engine in (*variant.engines, *variant.also), where, message)


def _require(condition: bool, where: str, message: str) -> None:
    if not condition:
        raise CaseError(f"$.{where}: {message}")
