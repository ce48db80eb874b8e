"""The jobs of a case: the scene of every variant, transformed, mutated or refined, for every engine that runs it."""

from __future__ import annotations

import hashlib
import warnings
from dataclasses import replace
from pathlib import Path
from typing import assert_never

import msgspec
import numpy as np

from crosscheck.engines.contract import Effort, LinearPart
from crosscheck.engines.linear.coordinates import coordinate_names, is_counted
from crosscheck.engines.registry import OWN_CODE, home
from crosscheck.library.case import TAKES_APART, CaseError, Comparison, Control, Refined, RunFile, Variant
from crosscheck.library.digests import case_digests
from crosscheck.library.find import Case
from crosscheck.library.mutations import mutate
from crosscheck.library.reference import current_reference, has_reference, scene_digest
from crosscheck.library.selection import alone, goals_for_reference, joining, select
from crosscheck.records.kinds import ENVELOPE, FILM, CaseRecord, RecordedReference, ReferenceGoals, VariantInfo
from crosscheck.records.packing import pack
from crosscheck.running.job import MAIN, REFINED, Job, with_efforts
from crosscheck.running.scheduler import TIME_LIMIT_S
from flexmb.scene.bodies import BeamBody, Modes, RigidBody, SidBody, StrainPolynomials
from flexmb.scene.check import SceneWarning, check_and_warn, check_scene
from flexmb.scene.schema import Scene
from flexmb.scene.strains import polynomials
from flexmb.surrogate import finite_segments, modal_points, rigidify, substructured
from flexmb.typing import Real
from flexmb.view.draw import draw
from flexmb.view.drawing import Drawing
from flexmb.view.film import film, film_channels

ENGINE = "native"  # of the run for an animation, which is never judged
FRAMES = 161  # of an animation
FILM_EFFORT = Effort("tolerance", 1e-10, "dop853")  # if the case prescribes none; else its coarsest is used


def plan(
    case: Case, asked: tuple[str, ...], provider: str, time_limit_s: float | None = None, films: bool = False
) -> tuple[CaseRecord, list[Job]]:
    """The record of a case, reduced to the engines asked for, and its jobs; `time_limit_s` replaces the case's own.

    With `films` every variant has another run, from which its animation is made.
    """
    run = (alone if case.alone else select)(case.run, asked)
    engines = {engine for variant in run.variants for engine in variant.engines}
    case = replace(case, claims=case.claims.of(engines))
    run = _with_efforts(run, case)
    infos: dict[str, VariantInfo] = {}
    jobs: list[Job] = []
    for variant in run.variants:
        scene, error = _attempt(case, variant)
        infos[variant.name] = _info(case, variant, scene, error)
        jobs += [_job(case, run, variant, MAIN, engine, scene, error, provider) for engine in variant.engines]
        if case.envelopes:
            own = (engine for engine in variant.engines if engine in OWN_CODE)
            followed = (_job(case, run, variant, ENVELOPE, engine, scene, error, provider) for engine in own)
            jobs += [replace(job, linear=(), kept=(), lean=True) for job in followed]
        if variant.refined is not None:
            scene, error = _attempt(case, refine(variant, variant.refined), variant.refined)
            crossing = _engines_compared_across(run, variant)
            jobs += [_job(case, run, variant, REFINED, engine, scene, error, provider) for engine in crossing]
        filmed = _film(case, run, variant, provider) if films else None
        if filmed is not None:
            job, drawing = filmed
            jobs.append(job)
            infos[variant.name] = msgspec.structs.replace(infos[variant.name], film=drawing)
    for control in run.controls:
        variant = run.variant(control.a.variant)
        scene, error = _attempt(case, variant, control=control)
        jobs.append(_job(case, run, variant, f"control:{control.name}", control.a.engine, scene, error, provider))
    limit = time_limit_s or case.run.time_limit_s or TIME_LIMIT_S
    jobs = [replace(job, time_limit_s=limit) for job in jobs]
    record = CaseRecord(
        case=case.name,
        run=run,
        provenance=case.provenance,
        readme=case.readme,
        variants=infos,
        accepted=case.accepted,
        reference=recorded_reference(case, run),
        files=case_digests(case.folder),
        asked=asked,
        joined=joining(case.run, asked),
        unreferenced=case.run.reference is not None and not has_reference(case.folder),
        whole=not asked and not case.alone,
        claims=case.claims,
    )
    return record, jobs


def _with_efforts(run: RunFile, case: Case) -> RunFile:
    """The run file with extra efforts in the ladders that it prescribes."""
    variants = list(run.variants)
    for engine in {effort.engine: None for effort in case.claims.efforts}:
        variants = [with_efforts(variant, engine, case.claims.efforts_of(engine)) for variant in variants]
    return msgspec.structs.replace(run, variants=tuple(variants))


def variant_scene(scene: Scene, variant: Variant, refined: Refined | None = None) -> Scene:
    """The scene with the variant's levels, transformation and start; `refined` sets the number of beam elements, or
    adds polynomials to strains."""
    scene = at_level(scene, variant)
    if refined is not None and refined.elements is not None:
        scene = _on_beams(scene, elements=refined.elements)
    if refined is not None and refined.polynomials is not None:
        scene = _with_polynomials(scene, refined.polynomials)
    return _begun(_transformed(scene, variant), variant)


def altered_scene(scene: Scene, variant: Variant) -> Scene:
    """`variant_scene` of a scene that was mutated or has drawn values: what its start contradicts then is meant."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        return variant_scene(scene, variant)


def _transformed(scene: Scene, variant: Variant) -> Scene:
    match variant.transform:
        case "rigidify":
            return rigidify(scene)
        case "modal_points":
            return modal_points(scene)
        case "segments":
            assert variant.segments is not None  # checked with the run file
            return finite_segments(scene, variant.split_body, variant.segments)
        case "substructures":
            assert variant.pieces is not None
            return substructured(scene, variant.split_body, variant.pieces, eigenmodes=variant.eigenmodes)
    return scene


def _begun(scene: Scene, variant: Variant) -> Scene:
    """The scene with its loops closed, or in its equilibrium where a variant begins there; a mutated one in its own."""
    if not scene.constraints and variant.start is msgspec.UNSET:
        return scene
    from crosscheck.running import starts  # loads the compiler

    match variant.start:
        case msgspec.UnsetType():
            return starts.closed(scene)
        case "equilibrium":
            return starts.at_rest(scene)
        case _:
            assert_never(variant.start)


def at_level(scene: Scene, variant: Variant) -> Scene:
    """The scene with every flexible body at the level of the variant, if it has one."""
    return scene if variant.level is None else _on_flexible(scene, level=variant.level)


def refine(variant: Variant, refined: Refined) -> Variant:
    """The variant with its refined number of segments or pieces."""
    counts = {key: getattr(refined, key) for key in ("segments", "pieces") if getattr(refined, key) is not None}
    return msgspec.structs.replace(variant, **counts)


def sample_times(run: RunFile, variant: Variant) -> Real:
    """Sample times of a variant (s), the case's unless it has its own."""
    return np.linspace(0.0, variant.duration_s or run.duration_s, variant.samples or run.samples)


def jobs_at(jobs: list[Job], times: Real) -> list[Job]:
    """The same jobs with samples at `times` (T,) s, which need not be equally spaced."""
    return [
        replace(job, times=times, scene_id="" if job.scene is None else scene_identity(job.scene, times, job.linear))
        for job in jobs
    ]


def scene_identity(scene: Scene, times: Real, linear: tuple[LinearPart, ...] = ()) -> str:
    """Digest of a scene, of the files it refers to, of the sample times, and of what is asked of the linearised motion:
    the same runs have the same digest."""
    digest = hashlib.sha256(msgspec.json.encode(scene))
    for body in scene.bodies:
        file = getattr(body, "file", None)
        if file is not None:
            digest.update(Path(file).read_bytes())
    digest.update(times.tobytes())
    digest.update(" ".join(sorted(linear)).encode())
    return digest.hexdigest()[:16]


def _attempt(
    case: Case, variant: Variant, refined: Refined | None = None, control: Control | None = None
) -> tuple[Scene | None, str]:
    """The checked scene of a variant, or None and the reason, so that one bad variant does not stop the others."""
    try:
        scene = case.scene(variant)
        if control is not None:  # the mutation changes the scene at the variant's level
            scene = mutate(at_level(scene, variant), control.mutation, control.target)
            scene = altered_scene(scene, msgspec.structs.replace(variant, level=None))
        else:
            scene = variant_scene(scene, variant, refined)
        check = check_and_warn if control is None else check_scene  # a mutated scene may be doubtful
        check(scene, t_end=variant.duration_s or case.run.duration_s)
        return scene, ""
    except (ValueError, NotImplementedError, OSError, SceneWarning) as error:  # --strict makes warnings errors
        return None, str(error)


def _job(
    case: Case, run: RunFile, variant: Variant, role: str, engine: str, scene: Scene | None, error: str, provider: str
) -> Job:
    times = sample_times(run, variant)
    linear = () if role == FILM else variant.asks
    scene_id = "" if scene is None else scene_identity(scene, times, linear)
    return Job(
        case.name, variant.name, role, engine, scene, scene_id, times, provider, home(engine),
        efforts=prescribed(variant, engine), extra=case.claims.efforts_of(engine),
        finer=run.finer if joining(case.run, [engine]) else 0, finest_only=role != MAIN,
        kept=tuple(chart.observable for chart in run.charts), error=error, linear=linear,
        rounding=role == MAIN and variant.moves_inputs,
    )  # fmt: skip


def _film(case: Case, run: RunFile, variant: Variant, provider: str) -> tuple[Job, Drawing] | None:
    """The run for the variant's animation; None if the recorded runs suffice or cannot be supplemented."""
    if ENGINE not in variant.engines:
        return None
    if variant.transform == "modal_points":  # draw the beams themselves
        variant = msgspec.structs.replace(variant, transform="none")
    scene, _ = _attempt(case, variant)
    made = None if scene is None else film(scene)
    if made is None:
        return None
    filmed, drawing = made
    filmed_as = msgspec.structs.replace(variant, samples=FRAMES)
    job = _job(case, run, filmed_as, FILM, ENGINE, filmed, "", provider)
    efforts = job.efforts[:1] or (FILM_EFFORT,)
    return replace(job, efforts=efforts, extra=(), finer=0, kept=film_channels(drawing), lean=True), drawing


def prescribed(variant: Variant, engine: str) -> tuple[Effort, ...]:
    """The efforts that the case prescribes for an engine, empty if they are left to the engine."""
    return tuple(
        Effort(kind=ladder.kind, value=value, method=ladder.method)
        for ladder in variant.efforts
        if ladder.engine == engine
        for value in ladder.values
    )


def _info(case: Case, variant: Variant, scene: Scene | None, error: str) -> VariantInfo:
    """The variant's info; bodies that it divides are drawn whole, since their markers keep their names."""
    if scene is None:
        return VariantInfo(level="", drawing=None, error=error)
    drawn = case.scene(variant) if variant.transform in TAKES_APART else scene
    drawable = all(not isinstance(body, SidBody) for body in drawn.bodies)  # a SID body's nodes are in its file
    drawing = draw(drawn) if drawable else None
    info = VariantInfo(
        level=_levels(scene), drawing=drawing, basis=scene_basis(case, variant),
        undetermined=_undetermined(scene, variant.duration_s or case.run.duration_s),
    )  # fmt: skip
    if not (variant.asks and is_counted(scene)):
        return info
    return msgspec.structs.replace(info, coordinates=coordinate_names(scene))


def _undetermined(scene: Scene, t_end: float) -> tuple[str, ...]:
    """Names of the components of loads that the motion of a scene leaves open: none of a tree."""
    if not scene.constraints:
        return ()
    from crosscheck.running.undetermined import undetermined  # loads the compiler

    return undetermined(scene, t_end).names


def scene_basis(case: Case, variant: Variant) -> str:
    """The basis of accepted figures of a variant: scene, transformation, refinement and times as written in files."""
    times = (variant.duration_s or case.run.duration_s, variant.samples or case.run.samples)
    text = f"{scene_digest(case, variant)} {times} {variant.refined}"
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _levels(scene: Scene) -> str:
    """The levels of the scene's bodies, as shown in verdicts: "rigid", "full", "full, rigid"."""
    levels = {body.level for body in scene.bodies if not isinstance(body, RigidBody)}
    return ", ".join(sorted(levels)) if levels else "rigid"


def _engines_compared_across(run: RunFile, variant: Variant) -> tuple[str, ...]:
    """Engines whose result of this variant is compared with another variant, so that its discretisation matters."""
    pairs: tuple[Comparison | Control, ...] = (*run.comparisons, *run.controls)
    crossing = [(a, b) for a, b in (pair.sides for pair in pairs) if a.variant != b.variant]
    engines = {side.engine for pair in crossing for side in pair if side.variant == variant.name}
    return tuple(engine for engine in variant.engines if engine in engines)


def _with_polynomials(scene: Scene, more: int) -> Scene:
    """The scene with so many polynomials more of each strain of its beams of level "exact"."""
    bodies = tuple(
        msgspec.structs.replace(body, modes=_with_more(body, more))
        if isinstance(body, BeamBody) and body.level == "exact"
        else body
        for body in scene.bodies
    )
    return msgspec.structs.replace(scene, bodies=bodies)


def _with_more(beam: BeamBody, more: int) -> Modes:
    counts = {strain: count + more for strain, count in polynomials(beam).items()}
    points = None if beam.modes.points is None else beam.modes.points + more
    return msgspec.structs.replace(beam.modes, polynomials=StrainPolynomials(**counts), points=points)


def _on_flexible(scene: Scene, **changes: object) -> Scene:
    bodies = tuple(
        body if isinstance(body, RigidBody) else msgspec.structs.replace(body, **changes) for body in scene.bodies
    )
    return msgspec.structs.replace(scene, bodies=bodies)


def _on_beams(scene: Scene, **changes: object) -> Scene:
    bodies = tuple(
        msgspec.structs.replace(body, **changes) if isinstance(body, BeamBody) else body for body in scene.bodies
    )
    return msgspec.structs.replace(scene, bodies=bodies)


def recorded_reference(case: Case, run: RunFile) -> RecordedReference | None:
    """The case's stored reference with the engines of the reduced run file `run` that are compared with it.

    None if there is no reference or no such engine. If the stored files cannot be used or belong to another scene, the
    record contains the fault, so that these comparisons show as not run.
    """
    recipe = case.run.reference
    if recipe is None or not has_reference(case.folder):
        return None
    running = [engine for variant in run.variants if variant.name == recipe.variant for engine in variant.engines]
    found = goals_for_reference(case.run, running)
    asked = {engine: ReferenceGoals(goals=goals, scales=scales) for engine, (goals, scales) in found.items()}
    if not asked:
        return None
    try:
        stored = current_reference(case)
    except CaseError as error:
        return RecordedReference(variant=recipe.variant, asked=asked, fault=str(error))
    return RecordedReference(
        variant=recipe.variant,
        asked=asked,
        times=pack(stored.times),
        channels={name: pack(rows) for name, rows in stored.channels.items()},
        uncertainties={name: known.uncertainty for name, known in stored.knowledge.channels.items()},
        routes=stored.knowledge.routes,
        work=stored.knowledge.work,
        made_with=stored.knowledge.made_with,
        provenance=stored.knowledge.provenance,
    )
