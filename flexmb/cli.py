"""The command `flexmb`: thin, it only reads words and shows results."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.text import Text

from flexmb.output.printable import printable
from flexmb.output.writing import check_folder, folder, in_words, writing
from flexmb.scene.check import SceneError, check_scene
from flexmb.scene.files import load_scene, save_scene
from flexmb.scene.reference import json_schema

EXIT_STOPPED = 1
EXIT_USAGE = 2
EXIT_INTERRUPTED = 130  # as of shells: 128 and the number of the signal

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    help="""
Simulate trees of rigid and flexible bodies, wheels and point masses.

A scene is a TOML file: see `docs/scene-reference.md`, or `flexmb schema` for the JSON Schema your editor understands.

Find every defect of a scene: `flexmb check scene.toml`

Run it, write CSV and charts: `flexmb simulate scene.toml --t-end 10 --out results`
""",
)
console = Console(markup=False, emoji=False)  # names and paths stand in what they print
errors = Console(stderr=True, markup=False, emoji=False)

SceneFile = Annotated[Path, typer.Argument(help="Scene file (TOML).", metavar="SCENE", show_default=False)]
End = Annotated[float | None, typer.Option("--t-end", help="Check that profiles cover the run up to here, in s.")]


@app.command()
def simulate(
    scene: SceneFile,
    t_end: Annotated[float, typer.Option("--t-end", help="End of the run in s; it starts at 0.", show_default=False)],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for trajectory.csv and charts.")] = Path("out"),
    method: Annotated[
        str,
        typer.Option(
            help="`dop853`; for stiff scenes `radau5`, `exponential`. With `--step`: `rk4`, `generalised_alpha`."
        ),
    ] = "dop853",
    rtol: Annotated[float, typer.Option(help="Relative error allowed in a step.")] = 1e-10,
    atol: Annotated[float, typer.Option(help="Absolute error allowed in a step, SI units.")] = 1e-12,
    step: Annotated[
        float | None, typer.Option(help="Step in s (rk4, generalised_alpha).", show_default=False)
    ] = None,
    spectral_radius: Annotated[
        float | None,
        typer.Option(help="What generalised_alpha leaves of unresolved modes in a step; 0.8.", show_default=False),
    ] = None,
    samples: Annotated[int, typer.Option(help="Output times, equally spaced, both ends included.")] = 201,
    algorithm: Annotated[
        str, typer.Option(help="`articulated` (recursion), `frisch` (nested bodies, 1975) or `frisch_as_printed`.")
    ] = "articulated",
    plots: Annotated[bool, typer.Option("--plots/--no-plots", help="Write charts beside the CSV.")] = True,
) -> None:
    """
    Simulate a scene; write `trajectory.csv` and charts; print a summary.

    **Examples**

        flexmb simulate boom.toml --t-end 60
        flexmb simulate boom.toml --t-end 60 --rtol 1e-12 --samples 1001 --out fine
        flexmb simulate boom.toml --t-end 60 --method rk4 --step 1e-3 --no-plots
        flexmb simulate boom.toml --t-end 60 --method exponential --rtol 1e-6 --atol 1e-8
        flexmb simulate boom.toml --t-end 60 --algorithm frisch

    **Columns** of the CSV are named `channel [unit]`: coordinates, speeds, markers, hinge loads, drives, energy,
    momentum. Markers and loads are in World axes; loads act on the outboard body about the outboard hinge point.

    **Exit code**: 0 finished, 1 stopped before the end (what was reached is written), 2 the scene or an option is
    wrong, 130 interrupted by Ctrl-C (what was reached is written).
    """
    interrupted = False
    with _no_traceback():
        from flexmb.run.interruption import Interrupted
        from flexmb.run.simulate import simulate as run  # after the words are understood: it loads the compiler
        from flexmb.run.summary import summary

        check_folder(out)
        with console.status(Text(f"simulating {scene} (the first run after an update compiles)")):
            try:
                trajectory = run(
                    load_scene(scene), t_end, method,  # type: ignore[arg-type]
                    rtol=rtol, atol=atol, step=step, samples=samples, algorithm=algorithm,  # type: ignore[arg-type]
                    spectral_radius=spectral_radius,
                )  # fmt: skip
            except Interrupted as stopped:
                trajectory, interrupted = stopped.trajectory, True
        console.print(summary(trajectory))  # first: a full disk takes the files only
        folder(out)
        with writing(out / "trajectory.csv"):
            trajectory.to_csv(out / "trajectory.csv")
        with writing(out):
            written = [out / "trajectory.csv", *(trajectory.plot(out) if plots else ())]
    console.print("wrote", ", ".join(str(path) for path in written), soft_wrap=True)
    if interrupted:
        raise typer.Exit(EXIT_INTERRUPTED)
    if not trajectory.finished:
        raise typer.Exit(EXIT_STOPPED)


@app.command()
def check(scene: SceneFile, t_end: End = None) -> None:
    """
    Check a scene without running it: every defect with its place and its remedy.

        flexmb check boom.toml --t-end 60

    **Exit code**: 0 sound, 2 wrong.
    """
    with _no_traceback():
        loaded = load_scene(scene)
        check_scene(loaded, t_end)
    counts = ", ".join(
        f"{len(getattr(loaded, key))} {key.replace('_', ' ')}" for key in ("bodies", "hinges", "markers")
    )
    console.print(Text.assemble(("sound", "green"), printable(f": {loaded.name} ({counts})")))


@app.command()
def equivalence(
    scene: SceneFile,
    body: Annotated[str, typer.Argument(help="Name of the flexible body.", metavar="BODY", show_default=False)],
    accuracy: Annotated[float, typer.Option(help="What counts as equal: a part of one.")] = 0.05,
    modes: Annotated[
        int | None, typer.Option(help="How many modes to look at; default all good ones.", show_default=False)
    ] = None,
    axis: Annotated[
        list[str] | None,
        typer.Option(help="Hinge axis, `y` or `0,0.6,0.8`, body axes; give it twice or thrice for more axes."),
    ] = None,
    mode: Annotated[
        list[int] | None, typer.Option(help="Mode that the hinge stands for, from 1; one for each axis.")
    ] = None,
    point: Annotated[
        str | None, typer.Option(help="A hinge to be judged as well, m from the clamp: `0.4,0,0`.", show_default=False)
    ] = None,
    angle: Annotated[float, typer.Option(help="Hinge angle in rad for the displacement forms (47), (49).")] = 0.1,
    picture: Annotated[Path, typer.Option("--picture", "-o", help="Picture file.")] = Path("out/equivalence.png"),
) -> None:
    """
    Modes or a rigid body on a spring hinge? Compare both models of an appendage; print tables, write a picture.

    The appendage is a flexible body at a limb end, clamped at its hinge. Frisch's three equivalence relations as
    numbers, the best hinge and its spring, how many modes are needed, and which model is better for which question.

    **Examples**

        flexmb equivalence gyrostat.toml panel
        flexmb equivalence gyrostat.toml panel --axis y --axis z --accuracy 0.01 --modes 20
        flexmb equivalence gyrostat.toml panel --point 0.5,0,0 --picture panel.png

    **Exit code**: 0 compared, 2 the scene, the body or an option is wrong.
    """
    with _no_traceback():
        from flexmb.frisch.equivalence.advice import equivalence as compare
        from flexmb.frisch.equivalence.appendage import appendage_of
        from flexmb.frisch.equivalence.picture import write_equivalence_plot
        from flexmb.frisch.equivalence.table import equivalence_tables

        loaded = load_scene(scene)
        check_scene(loaded)
        check_folder(picture.parent)
        result = compare(
            appendage_of(loaded, body, modes),
            accuracy=accuracy,
            axes=[_vector("axis", word) for word in axis] if axis else None,
            modes=tuple(number - 1 for number in mode) if mode else None,
            point=None if point is None else _vector("point", point),
        )
        console.print(equivalence_tables(result, angle))
        with writing(picture):
            written = write_equivalence_plot(result, picture)
    console.print("wrote", str(written), soft_wrap=True)


@app.command()
def advise(
    scene: SceneFile,
    tol: Annotated[float, typer.Option("--tol", help="Error allowed, a part of the quantity's scale.")] = 1e-2,
    quantity: Annotated[
        list[str] | None,
        typer.Option("--quantity", "-q", help="What matters; give it several times. Default: all markers' positions."),
    ] = None,
    t_end: Annotated[float, typer.Option("--t-end", help="End of the run in s; it starts at 0.")] = 10.0,
    out: Annotated[Path, typer.Option("--out", "-o", help="File of the reduced scene.")] = Path("out/advised.toml"),
    trials: Annotated[bool, typer.Option("--trials/--no-trials", help="Show every model that was run.")] = True,
) -> None:
    """
    Which model of each flexible body, and which method, are good enough? Run the candidates; print why.

    Rigid, rigid on a spring hinge, so many modes at some level, pieces: the cheapest that gives the quantity to the
    tolerance, measured against the finest models that can be run, up to the same end. Writes the reduced scene.

    **Examples**

        flexmb advise gyrostat.toml --tol 1e-3 --t-end 10
        flexmb advise gyrostat.toml --tol 1e-2 --quantity marker:tip.position --quantity load:mount.torque
        flexmb advise gyrostat.toml --tol 1e-2 --quantity marker:tip.position@0.05 --out small.toml

    **Quantities** are `marker:NAME.position`, `.orientation`, `.velocity`, `.angular_velocity`, `load:HINGE.torque`,
    `.force`, `wheel_load:WHEEL.torque`, `drive:NAME`, `energy.total`, `momentum.angular`, patterns such as
    `marker:*.position`, and beginnings such as `energy`. Errors are relative to the range of the signal, or to the size
    after @, in SI units.

    **Exit code**: 0 advised, 1 no model known to be adequate, 2 the scene or an option is wrong.
    """
    with _no_traceback():
        from flexmb.advisor.advice import advise as search
        from flexmb.advisor.verdict import verdict

        loaded = load_scene(scene)
        check_folder(out.parent)
        with console.status(Text(f"trying models of {scene} (the first run after an update compiles)")):
            advice = search(loaded, tol, quantity, t_end)
        console.print(verdict(advice, trials))
        if advice.scene is None or advice.method is None:
            raise typer.Exit(EXIT_STOPPED)
        folder(out.parent)
        with writing(out):
            save_scene(advice.scene, out)
    console.print("wrote", str(out), soft_wrap=True)
    console.print(f"flexmb simulate {out} --t-end {t_end:g} {advice.method.words()}", soft_wrap=True)


@app.command()
def linearize(
    scene: SceneFile,
    at: Annotated[str, typer.Option(help="`equilibrium` found from the initial state, or the `initial` state.")] = (
        "equilibrium"
    ),
    spin: Annotated[
        str | None, typer.Option(help="Hinge or wheel that spins steadily instead, at `--rate`.", show_default=False)
    ] = None,
    rate: Annotated[float, typer.Option(help="Its rate in rad/s.")] = 0.0,
    export: Annotated[
        Path | None, typer.Option(help="File of matrices, names and eigenvalues: .npz or .mat.", show_default=False)
    ] = None,
) -> None:
    """
    Linearise a scene by exact derivatives; print frequency, damping and dominant coordinates of every mode.

    At `equilibrium` and for a spin, functions of time stand still at their values at t = 0; at the `initial` state
    prescribed motions go on as their functions have them.

    **Examples**

        flexmb linearize arm.toml
        flexmb linearize gyrostat.toml --at initial --export gyrostat.npz
        flexmb linearize rotor.toml --spin shaft --rate 30

    **Exported** are A, B, C, D of x' = A x + B f, y = C x + D f with x = [displacements; speeds], their names and
    units, the mass matrix and the eigenvalues.

    **Exit code**: 0 linearised, 1 no equilibrium was found, 2 the scene or an option is wrong.
    """
    with _no_traceback():
        from flexmb.linear.equilibrium import EquilibriumError, equilibrium
        from flexmb.linear.linearize import linearize as linearized
        from flexmb.linear.spin import steady_spin
        from flexmb.linear.table import modes_table
        from flexmb.system.system import compile

        if at not in ("equilibrium", "initial"):
            raise ValueError(f"--at is equilibrium or initial, not {at!r}")
        loaded = load_scene(scene)
        try:
            with console.status(Text(f"linearising {scene} (the first time after an update compiles)")):
                system = compile(loaded)
                if spin is not None:
                    model = steady_spin(system, spin, rate).linearize()
                elif at == "equilibrium":
                    model = linearized(system, equilibrium(system), held=True)
                else:
                    model = linearized(system)
        except EquilibriumError as error:
            errors.print(Text("error: ", style="bold red") + Text(printable(str(error))), soft_wrap=True)
            raise typer.Exit(EXIT_STOPPED) from None
        console.print(modes_table(model))
        if export is not None:
            with writing(export):
                console.print("wrote", str(model.save(export)), soft_wrap=True)


@app.command()
def campbell(
    scene: SceneFile,
    hinge: Annotated[str, typer.Argument(help="Revolute hinge or wheel that spins.", metavar="HINGE")],
    rates: Annotated[str, typer.Option(help="Rates in rad/s: `from:to:count`.", show_default=False)],
    modes: Annotated[
        int | None, typer.Option(help="How many of the lowest modes to draw; default all.", show_default=False)
    ] = None,
    picture: Annotated[Path, typer.Option("--picture", "-o", help="Picture file.")] = Path("out/campbell.png"),
    csv: Annotated[Path | None, typer.Option(help="File for the numbers.", show_default=False)] = None,
) -> None:
    """
    Frequencies and growth rates against a spin rate: a table and a picture.

    At each rate the deformation is found in which nothing accelerates, and the scene linearised about it by exact
    derivatives. Modes are seen from the turning bodies and followed by their shapes.

    **Examples**

        flexmb campbell blade.toml shaft --rates 0:40:41
        flexmb campbell blade.toml shaft --rates 0:40:41 --modes 6 --picture blade.png --csv blade.csv

    **Exit code**: 0 drawn, 1 a rate has no steady state, 2 the scene or an option is wrong.
    """
    with _no_traceback():
        from flexmb.linear.campbell import campbell as diagram
        from flexmb.linear.equilibrium import EquilibriumError
        from flexmb.linear.picture import write_campbell_plot
        from flexmb.linear.table import campbell_table

        loaded, values = load_scene(scene), _range("rates", rates)
        for file in (picture, *([] if csv is None else [csv])):
            check_folder(file.parent)
        try:
            with console.status(Text(f"linearising {scene} (the first time after an update compiles)")):
                result = diagram(loaded, hinge, values)
        except EquilibriumError as error:
            errors.print(Text("error: ", style="bold red") + Text(printable(str(error))), soft_wrap=True)
            raise typer.Exit(EXIT_STOPPED) from None
        console.print(campbell_table(result))
        with writing(picture):
            written = [write_campbell_plot(result, picture, modes)]
        if csv is not None:
            with writing(csv):
                written.append(result.to_csv(csv))
    console.print("wrote", ", ".join(str(path) for path in written), soft_wrap=True)


@app.command()
def schema() -> None:
    """
    Print the JSON Schema of scene files.

    Point your editor's TOML or JSON language server at it for completion and inline errors:

        flexmb schema > scene.schema.json
    """
    print(json_schema())


def _vector(option: str, text: str) -> tuple[float, ...]:
    """Three numbers, or the unit vector of x, y, z."""
    if text in ("x", "y", "z"):
        return tuple(float(text == name) for name in "xyz")
    try:
        numbers = tuple(float(word) for word in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != 3:
        raise ValueError(f"--{option} is x, y, z or three numbers such as 0,0.6,0.8; got {text!r}")
    return numbers


def _range(option: str, text: str) -> list[float]:
    """`from:to:count`, ends included."""
    try:
        first, last, count = text.split(":")
        start, stop, steps = float(first), float(last), int(count)
    except ValueError:
        raise ValueError(f"--{option} is from:to:count, such as 0:40:41; got {text!r}") from None
    if steps < 2:
        raise ValueError(f"--{option}: give at least 2 values, not {steps}")
    return [start + (stop - start) * i / (steps - 1) for i in range(steps)]


@contextmanager
def _no_traceback() -> Iterator[None]:
    """What the user can put right is a message, not a traceback."""
    try:
        yield
    except BrokenPipeError:  # whoever read the output has read enough
        raise
    except (SceneError, NotImplementedError, ValueError, ImportError, OSError) as error:
        text = in_words(error) if isinstance(error, OSError) else str(error)
        errors.print(Text("error: ", style="bold red") + Text(printable(text)), soft_wrap=True)
        raise typer.Exit(EXIT_USAGE) from None
    except ArithmeticError as error:  # there are no accelerations, or they overflow
        errors.print(Text("error: ", style="bold red") + Text(str(error)), soft_wrap=True)
        raise typer.Exit(EXIT_STOPPED) from None


def main() -> None:
    """Entry point of the command `flexmb`."""
    app()


if __name__ == "__main__":
    main()
