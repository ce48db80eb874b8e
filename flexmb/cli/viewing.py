"""`flexmb view`: a scene in three dimensions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from flexmb.cli.terminal import EXIT_STOPPED, NoUserCode, SceneFile, console, no_traceback
from flexmb.output.files import check_folder
from flexmb.output.printable import printable

if TYPE_CHECKING:
    from flexmb.scene.schema import Scene
    from flexmb.view.scene_view import View


def view(
    scene: SceneFile,
    run: Annotated[
        Path | None,
        typer.Argument(help="A stored run: its folder, CSV or .npz.", metavar="[RUN]", show_default=False),
    ] = None,
    t_end: Annotated[float | None, typer.Option("--t-end", help="Run to this time in s.", show_default=False)] = None,
    mode: Annotated[
        int | None,
        typer.Option(help="Number of a mode, as `flexmb linearize` lists them.", show_default=False, min=1),
    ] = None,
    spin: Annotated[
        str | None, typer.Option(help="With --mode: hinge or wheel in a steady spin at `--rate`.", show_default=False)
    ] = None,
    rate: Annotated[float, typer.Option(help="Rate of the spin in rad/s.")] = 0.0,
    out: Annotated[Path, typer.Option("--out", "-o", help="File, which ends in .html.")] = Path("out/view.html"),
    no_user_code: NoUserCode = False,
) -> None:
    """
    Write a scene in three dimensions as one HTML page that needs no network: its start, a run, or a mode.

    **Examples**

        flexmb view boom.toml
        flexmb view boom.toml --t-end 60 --out boom.html
        flexmb view boom.toml --mode 3
        flexmb view rotor.toml --mode 2 --spin shaft --rate 30
        flexmb simulate boom.toml --t-end 60 --out out && flexmb view boom.toml out

    `--t-end` makes a run by default settings; RUN is one that `flexmb simulate` has written. A mode is that about the
    equilibrium, or about a steady spin as `flexmb campbell` has it, with an amplitude for display.

    **Exit code**: 0 written, 1 the run stopped before its end (what was reached is written) or no equilibrium was
    found, 2 the scene or an option is wrong.
    """
    with no_traceback():
        from flexmb.scene.files import load_scene
        from flexmb.view.page import html_file

        if sum(asked is not None for asked in (run, t_end, mode)) > 1:
            raise ValueError("RUN, --t-end and --mode exclude each other: a page shows a run or a mode")
        if spin is not None and mode is None:
            raise ValueError("--spin is for modes: name one by --mode, as `flexmb linearize --spin` lists them")
        if spin is None and rate != 0.0:
            raise ValueError(f"--rate {rate:g} is the rate of a spin: name its hinge or wheel by --spin")
        check_folder(html_file(out).parent)
        loaded, message = load_scene(scene), ""
        with console.status(Text(f"drawing {scene} (the first time after an update compiles)")):
            if run is not None:
                from flexmb.run.stored import stored_view

                shown = stored_view(loaded, run)
            elif t_end is not None:
                from flexmb.run.simulate import simulate

                made = simulate(loaded, t_end)
                shown, message = made.view(), "" if made.finished else made.message
            else:
                shown = _start(loaded) if mode is None else _mode(loaded, mode, spin, rate)
            shown.save(out)
        if message:
            console.print(Text(printable(message), style="yellow"))
        console.print("wrote", str(out), soft_wrap=True)
    if message:
        raise typer.Exit(EXIT_STOPPED)


def _start(scene: Scene) -> View:
    """The scene at its initial state."""
    from flexmb.system.compile import compile as compiled
    from flexmb.view.scene_view import applied_at, scene_view

    system = compiled(scene)
    state, (names, _) = system.initial_state, system.state_names
    applied = applied_at([system], [state])
    return scene_view([system.scene], [state], [name for name, _ in names], "initial state", applied=applied)


def _mode(scene: Scene, number: int, spin: str | None, rate: float) -> View:
    """A mode about the equilibrium, or a steady spin, over one period."""
    from flexmb.linear.mode_view import mode_view

    return mode_view(scene, number, spin, rate)
