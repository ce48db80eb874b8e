"""`flexmb linearize` and `flexmb campbell`: linear models, and frequencies as functions of a spin rate."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from flexmb.cli.terminal import NoUserCode, SceneFile, console, no_traceback, range_of
from flexmb.output.files import check_folder
from flexmb.output.printable import printable

if TYPE_CHECKING:
    from flexmb.linear.linear_model import LinearModel
    from flexmb.system.system import System
    from flexmb.typing import Real


def linearize(
    scene: SceneFile,
    at: Annotated[str, typer.Option(help="`equilibrium` found from the initial state, or the `initial` state.")] = (
        "equilibrium"
    ),
    spin: Annotated[
        str | None, typer.Option(help="Hinge or wheel in a steady spin at `--rate`.", show_default=False)
    ] = None,
    rate: Annotated[float, typer.Option(help="Rate of the spin in rad/s.")] = 0.0,
    cut: Annotated[
        bool,
        typer.Option("--truncation/--no-truncation", help="Linearise again with twice the modes of every beam."),
    ] = True,
    sampled: Annotated[
        bool, typer.Option("--sampled", help="Scenes with sampled controllers: multipliers over a period, and margins.")
    ] = False,
    picture: Annotated[
        Path | None, typer.Option(help="With --sampled: Bode and Nyquist diagrams, a file.", show_default=False)
    ] = None,
    loop: Annotated[
        str | None, typer.Option(help="Signal at which the loop of the picture is opened.", show_default=False)
    ] = None,
    export: Annotated[
        Path | None, typer.Option(help="File of matrices, names and eigenvalues: .npz or .mat.", show_default=False)
    ] = None,
    no_user_code: NoUserCode = False,
) -> None:
    """
    Linearise a scene by exact derivatives; print frequency, damping and dominant coordinates of every mode.

    At `equilibrium` and for a spin, functions of time have their constant values at t = 0; at the `initial` state
    prescribed motions continue by their functions.

    **Examples**

        flexmb linearize arm.toml
        flexmb linearize gyrostat.toml --at initial --export gyrostat.npz
        flexmb linearize rotor.toml --spin shaft --rate 30
        flexmb linearize satellite.toml --sampled --picture loop.png

    **Sampled** controllers act at instants: with `--sampled` the model is exact over the period after which all repeat.
    Its multipliers are printed with gain, phase and delay margins of every loop, opened at outputs of controllers and
    at sensors.

    **Truncation** is the relative change of each eigenvalue when every beam has twice its modes, an estimate of the
    truncation error. Motions without stiffness are listed as rigid-body motions.

    **Exported** are A, B, C, D of x' = A x + B f, y = C x + D f with x = [displacements; speeds], their names and
    units, the mass matrix and the eigenvalues.

    **Exit code**: 0 linearised, 1 no equilibrium was found, 2 the scene or an option is wrong.
    """
    with no_traceback():
        from flexmb.linear.linear_tables import modes_table

        if at not in ("equilibrium", "initial"):
            raise ValueError(f"--at is equilibrium or initial, not {at!r}")
        if sampled:
            _show_sampled(scene, at, spin, picture, loop, export)
            return
        if picture is not None or loop is not None:
            raise ValueError("--picture and --loop are of sampled loops: add --sampled")
        with console.status(Text(f"linearising {scene} (the first time after an update compiles)")):
            model, missing, note = _linearised(scene, at, spin, rate, cut)
        console.print(modes_table(model, missing))
        if note:
            console.print(Text(printable(note), style="yellow"))
        if export is not None:
            console.print("wrote", str(model.save(export)), soft_wrap=True)


def _show_sampled(
    scene: Path, at: str, spin: str | None, picture: Path | None, loop: str | None, export: Path | None
) -> None:
    """Print the model of a sampled loop, and write its files."""
    from flexmb.linear.equations import built
    from flexmb.linear.linear_tables import sampled_table
    from flexmb.linear.linearize_sampled import linearize_sampled
    from flexmb.scene.files import load_scene

    if spin is not None:
        raise ValueError("--spin and --sampled exclude each other: steady spins are of scenes without controllers")
    if picture is not None:
        check_folder(picture.parent)
    with console.status(Text(f"linearising {scene} (the first time after an update compiles)")):
        system = built(load_scene(scene))
        model = linearize_sampled(system, state=None if at == "equilibrium" else system.initial_state)
    console.print(sampled_table(model))
    written = [] if export is None else [model.save(export)]
    written += [] if picture is None else [model.plot(picture, loop)]
    if written:
        console.print("wrote", ", ".join(str(path) for path in written), soft_wrap=True)


def _linearised(
    scene: Path, at: str, spin: str | None, rate: float, cut: bool
) -> tuple[LinearModel, Real | None, str]:
    """The linear model, the truncation of its eigenvalues if asked for and known, and why it is not known."""
    from flexmb.linear.equations import built
    from flexmb.linear.equilibrium import equilibrium
    from flexmb.linear.linearize import linearize as linearized
    from flexmb.linear.spin import steady_spin
    from flexmb.linear.truncation import truncation
    from flexmb.scene.bodies import BeamBody
    from flexmb.scene.files import load_scene

    def linear(system: System) -> LinearModel:
        if spin is not None:
            return steady_spin(system, spin, rate).linearize()
        if at == "equilibrium":
            return linearized(system, equilibrium(system), held=True)
        return linearized(system)

    if spin is None and rate != 0.0:
        raise ValueError(f"--rate {rate:g} is the rate of a spin: name its hinge or wheel by --spin")
    loaded = load_scene(scene)
    model = linear(built(loaded))
    if not cut or not any(isinstance(body, BeamBody) and body.level != "rigid" for body in loaded.bodies):
        return model, None, ""
    try:
        return model, truncation(model, loaded, linear), ""
    except ArithmeticError as error:  # no equilibrium, or no accelerations: more modes may buckle
        return model, None, f"the truncation is not known; with twice the modes of every beam: {error}"


def campbell(
    scene: SceneFile,
    hinge: Annotated[str, typer.Argument(help="Revolute hinge or wheel that spins.", metavar="HINGE")],
    rates: Annotated[str, typer.Option(help="Rates in rad/s: `from:to:count`.", show_default=False)],
    modes: Annotated[
        int | None,
        typer.Option(help="Number of modes to draw, lowest first; by default all.", min=1, show_default=False),
    ] = None,
    picture: Annotated[Path, typer.Option("--picture", "-o", help="Picture file.")] = Path("out/campbell.png"),
    csv: Annotated[Path | None, typer.Option(help="File for the numbers.", show_default=False)] = None,
    no_user_code: NoUserCode = False,
) -> None:
    """
    Frequencies and growth rates as functions of a spin rate (Campbell diagram): a table and a picture.

    At each rate the scene is linearised about its steady state by exact derivatives. Frequencies are those in the
    rotating frame, and modes are tracked by their shapes.

    **Examples**

        flexmb campbell blade.toml shaft --rates 0:40:41
        flexmb campbell blade.toml shaft --rates 0:40:41 --modes 6 --picture blade.png --csv blade.csv

    **Exit code**: 0 drawn, 1 a rate has no steady state, 2 the scene or an option is wrong.
    """
    with no_traceback():
        from flexmb.linear.campbell import campbell as diagram
        from flexmb.linear.linear_tables import campbell_table
        from flexmb.scene.files import load_scene

        loaded, values = load_scene(scene), range_of("rates", rates)
        for file in (picture, *([] if csv is None else [csv])):
            check_folder(file.parent)
        with console.status(Text(f"linearising {scene} (the first time after an update compiles)")):
            result = diagram(loaded, hinge, values)
        console.print(campbell_table(result))
        written = [result.plot(picture, modes)]
        if csv is not None:
            written.append(result.to_csv(csv))
    console.print("wrote", ", ".join(str(path) for path in written), soft_wrap=True)
