"""`flexmb simulate`: run a scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer
from rich.text import Text
from typer import Option

from flexmb.cli.terminal import EXIT_INTERRUPTED, EXIT_STOPPED, NoUserCode, SceneFile, Strict, console, no_traceback
from flexmb.integrate.integrator import Method
from flexmb.output.files import check_folder, folder, whole_file
from flexmb.scene.problems import closest

if TYPE_CHECKING:
    from flexmb.run.trajectory import Trajectory
    from flexmb.scene.bodies import BeamBody


METHODS = ", ".join(f"`{name}`" for name in get_args(Method))

EndTime = Annotated[float, Option("--t-end", help="End of the run in s.", show_default=False)]
StartTime = Annotated[float | None, Option("--from-time", help="Start of the run in s; default 0.", show_default=False)]
Samples = Annotated[int, Option(help="Output times, equally spaced, both ends included.")]

MethodName = Annotated[str, Option(help=f"{METHODS}: see docs/integrators.md. Fixed-step methods need `--step`.")]
Relative = Annotated[float, Option(help="Relative tolerance for the error of a step.")]
Absolute = Annotated[float, Option(help="Absolute tolerance for the error of a step, SI units.")]
Step = Annotated[float | None, Option(help="Step in s (rk4, generalised_alpha).", show_default=False)]
SpectralRadius = Annotated[
    float | None, Option(help="Spectral radius of generalised_alpha; default 0.8.", show_default=False)
]
AlgorithmName = Annotated[
    str,
    Option(
        help="`articulated` (recursion), `composite` (mass matrix), `frisch` (nested bodies, 1975) or "
        "`frisch_as_printed`."
    ),
]

Values = Annotated[
    list[str] | None,
    Option("--set", help="A value in the scene, `rod.mass_kg=2.0`; may be repeated.", show_default=False),
]
RestartFile = Annotated[
    Path | None, Option(help="Resume from `restart.npz` of another run, bit-identically.", show_default=False)
]

Folder = Annotated[Path, Option("--out", "-o", help="Folder for trajectory.csv and charts.")]
Also = Annotated[
    list[str] | None,
    Option(help="Beside the CSV: `npz`, `parquet`, `rrd` for the viewer rerun, `html` for charts; may be repeated."),
]
Envelope = Annotated[
    bool | None,
    Option(
        "--envelope/--no-envelope",
        help="Follow the run again over all of its steps for the peaks of loads, and write envelope.csv. By default "
        "short runs are followed for the table of peaks alone.",
        show_default=False,
    ),
]
Quiet = Annotated[bool, Option("--quiet", "-q", help="Print the names of the files that are written, and errors.")]
Plots = Annotated[bool, Option("--plots/--no-plots", help="Write charts beside the CSV.")]
Sections = Annotated[
    list[str] | None,
    Option(help="Loads across a beam's sections, to sections-BEAM.csv: `BEAM`, or `BEAM:x,x,...` in m."),
]
ErrorEstimate = Annotated[
    bool, Option("--error-estimate", help="Run again with tighter tolerances; print each channel's largest error.")
]


FORMATS = {"npz": "to_npz", "parquet": "to_parquet", "rrd": "to_rerun", "html": "plot"}
"""Endings, and the methods of a trajectory that write them."""

ENVELOPE = "envelope.csv"
SHORT = 2_000_000  # numbers of states that a run has evaluated: it is then followed over its steps in about a second
SECTIONS = 21  # equally spaced, where no positions are given


def simulate(
    scene: SceneFile,
    t_end: EndTime,
    out: Folder = Path("out"),
    method: MethodName = "dop853",
    rtol: Relative = 1e-10,
    atol: Absolute = 1e-12,
    step: Step = None,
    spectral_radius: SpectralRadius = None,
    from_time: StartTime = None,
    values: Values = None,
    restart: RestartFile = None,
    samples: Samples = 201,
    algorithm: AlgorithmName = "articulated",
    envelope: Envelope = None,
    also: Also = None,
    plots: Plots = True,
    sections: Sections = None,
    error: ErrorEstimate = False,
    strict: Strict = False,
    quiet: Quiet = False,
    no_user_code: NoUserCode = False,
) -> None:
    """
    Simulate a scene; write `trajectory.csv`, `restart.npz` and charts; print a summary and where loads have peaks.

    **Examples**

        flexmb simulate boom.toml --t-end 60
        flexmb simulate boom.toml --t-end 60 --rtol 1e-12 --samples 1001 --out fine
        flexmb simulate boom.toml --t-end 60 --method rk4 --step 1e-3 --no-plots
        flexmb simulate boom.toml --t-end 60 --method exponential --rtol 1e-6 --atol 1e-8
        flexmb simulate boom.toml --t-end 60 --algorithm frisch
        flexmb simulate boom.toml --t-end 60 --envelope
        flexmb simulate boom.toml --t-end 60 --also parquet --also rrd
        flexmb simulate boom.toml --t-end 60 --set tip.mass_kg=0.2 --set hub_hinge.rotation.angle_rad=0.1
        flexmb simulate boom.toml --t-end 120 --restart out/restart.npz --out later
        flexmb simulate boom.toml --t-end 60 --sections strip --sections mast:0,0.5,1 --error-estimate

    **Columns** of the CSV are named `channel [unit]`: coordinates, speeds, markers, hinge loads, drives, energy,
    momentum. Markers and loads are in World axes; loads act on the outboard body about the outboard hinge point. They
    are values at the output times: peaks between these are found by `--envelope`, one row per channel.

    **Exit code**: 0 finished, 1 stopped before the end (what was reached is written), 2 the scene or an option is
    wrong, or the scene is doubtful with `--strict`, 130 interrupted by Ctrl-C (what was reached is written).
    """
    with no_traceback(strict):
        check_folder(out)
        _check_formats(also or ())
        wanted = _sections(scene, sections or ())
        settings = {
            "method": method, "t_start": from_time, "rtol": rtol, "atol": atol, "step": step, "samples": samples,
            "algorithm": algorithm, "spectral_radius": spectral_radius,
        }  # fmt: skip
        with console.status(Text(f"simulating {scene} (the first run after an update compiles)")):
            trajectory, interrupted = _run(scene, t_end, values or (), restart, settings)
        _report(trajectory, out, also or (), plots, wanted, quiet)
        if envelope and not interrupted:
            _write_envelope(trajectory, out / ENVELOPE)
        if error and not interrupted:
            _estimate_error(trajectory)
        if not quiet and len(trajectory.t):
            _tell_peaks(trajectory, followed=False if interrupted else envelope)
    if interrupted:
        raise typer.Exit(EXIT_INTERRUPTED)
    if not trajectory.finished:
        raise typer.Exit(EXIT_STOPPED)


def _check_formats(words: Sequence[str]) -> None:
    for word in words:
        if word not in FORMATS:
            raise ValueError(f"--also is one of {', '.join(FORMATS)}; got {word!r}")


def _run(
    scene: Path, t_end: float, values: Sequence[str], restart: Path | None, settings: dict[str, Any]
) -> tuple[Trajectory, bool]:
    """The trajectory of the scene with other values, and whether Ctrl-C interrupted it."""
    from flexmb.run.interruption import Interrupted
    from flexmb.run.restart import Restart
    from flexmb.run.simulate import simulate as run  # only now, since it loads the compiler
    from flexmb.scene.files import load_scene
    from flexmb.scene.values import parsed

    changed = load_scene(scene).with_values(dict(map(parsed, values)))
    state = None if restart is None else Restart.load(restart)
    try:
        return run(changed, t_end, state=state, **settings), False
    except Interrupted as stopped:
        return stopped.trajectory, True


def _report(
    trajectory: Trajectory, out: Path, also: Sequence[str], plots: bool, sections: dict[str, list[float]], quiet: bool
) -> None:
    """Print the summary first, since a full disk then costs the files only; write the files, section loads last."""
    from flexmb.run.exports import write_sections
    from flexmb.run.summary import summary

    if not quiet:
        console.print(summary(trajectory))
    written = _written(trajectory, out, also, plots)
    console.print("wrote", ", ".join(str(path) for path in written), soft_wrap=True)
    for name, x in sections.items():
        path = out / f"sections-{name}.csv"
        write_sections(path, trajectory.t, trajectory.section_loads(name, x))
        console.print("wrote", str(path), soft_wrap=True)


def _write_envelope(trajectory: Trajectory, path: Path) -> None:
    with console.status(Text("following the run over all of its steps")):
        envelope = trajectory.envelope
    with whole_file(path) as beside:
        envelope.to_csv(beside)
    console.print("wrote", str(path), soft_wrap=True)


def _tell_peaks(trajectory: Trajectory, followed: bool | None) -> None:
    """Print the peaks of loads over all steps if the run was followed, or is short; else those of the output times."""
    from flexmb.run.summary import peaks_table

    sampled = f"the {len(trajectory.t)} output times"
    if followed is None:
        states = trajectory.statistics.evaluations * (len(trajectory.q_names) + len(trajectory.u_names))
        followed, why = states <= SHORT, "; --envelope finds those between"
    else:
        why = ""
    if followed:
        try:
            console.print(peaks_table(trajectory, trajectory.envelope))
            return
        except ArithmeticError as error:  # the run itself has ended well
            why = f": {error}"
    console.print(peaks_table(trajectory, trajectory.sampled_envelope, sampled + why))


def _estimate_error(trajectory: Trajectory) -> None:
    from flexmb.run.summary import errors_table

    with console.status(Text("running again with tighter tolerances")):
        estimated = errors_table(trajectory, trajectory.error_estimate())
    console.print(estimated)


def _written(trajectory: Trajectory, out: Path, also: Sequence[str], plots: bool) -> list[Path]:
    """The files of a run, in a folder that is made for them: a trajectory with its own restart, or neither."""
    folder(out)
    restart = out / "restart.npz"
    writers: dict[Path, Callable[[Path], None]] = {out / "trajectory.csv": trajectory.to_csv}
    writers |= {out / f"trajectory.{word}": getattr(trajectory, FORMATS[word]) for word in dict.fromkeys(also)}
    if trajectory.restart is not None:
        writers[restart] = trajectory.restart.save
    with ExitStack() as together:
        for path, write in writers.items():
            write(together.enter_context(whole_file(path)))
    for other in {restart, out / ENVELOPE} - set(writers):
        other.unlink(missing_ok=True)  # of an earlier run
    return [*writers, *(trajectory.plot(out) if plots else ())]


def _sections(scene: Path, words: Sequence[str]) -> dict[str, list[float]]:
    """Positions (m) along beams of the scene by the beams' names."""
    from flexmb.scene.bodies import BeamBody
    from flexmb.scene.files import load_scene

    beams = {body.name: body for body in load_scene(scene).bodies if isinstance(body, BeamBody)}
    return dict(_section(beams, word) for word in words)


def _section(beams: dict[str, BeamBody], word: str) -> tuple[str, list[float]]:
    """A beam and positions along it (m), equally spaced by default; ValueError if there is no such beam."""
    name, _, places = word.rpartition(":") if ":" in word else (word, "", "")
    if word in beams:  # a name may hold a colon
        name, places = word, ""
    if name not in beams:
        raise ValueError(f"--sections: there is no beam {name!r}: {closest(name, beams)}")
    if not places:
        return name, [beams[name].length_m * i / (SECTIONS - 1) for i in range(SECTIONS)]
    try:
        found = [float(place) for place in places.split(",")]
    except ValueError:
        raise ValueError(f"--sections is BEAM or BEAM:x,x,...; got {word!r}") from None
    if not all(0.0 <= x <= beams[name].length_m for x in found):
        raise ValueError(f"--sections: beam {name!r} reaches from 0 to {beams[name].length_m:g} m, not {places}")
    return name, found
