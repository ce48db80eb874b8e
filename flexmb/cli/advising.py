"""`flexmb advise`: which models and which method are good enough."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from flexmb.cli.terminal import EXIT_STOPPED, NoUserCode, SceneFile, console, no_traceback
from flexmb.output.files import check_folder, folder


def advise(
    scene: SceneFile,
    tol: Annotated[float, typer.Option("--tol", help="Allowed error, relative to the quantity's scale.")] = 1e-2,
    quantity: Annotated[
        list[str] | None,
        typer.Option("--quantity", "-q", help="Quantity; may be repeated. Default: the positions of all markers."),
    ] = None,
    t_end: Annotated[float, typer.Option("--t-end", help="End of the run in s; it starts at 0.")] = 10.0,
    out: Annotated[Path, typer.Option("--out", "-o", help="File of the reduced scene.")] = Path("out/advised.toml"),
    trials: Annotated[bool, typer.Option("--trials/--no-trials", help="Show every model that was run.")] = True,
    budget: Annotated[float, typer.Option("--budget", help="Factor of the operations that runs may take.")] = 1.0,
    no_user_code: NoUserCode = False,
) -> None:
    """
    Find the cheapest model of each flexible body, and method, that give a quantity to a tolerance; print the reasons.

    Candidates are rigid bodies, rigid bodies on spring hinges, modes at several levels, and pieces. They are run up to
    the given end, and measured against the finest models that can be run. Writes the reduced scene.

    **Examples**

        flexmb advise gyrostat.toml --tol 1e-3 --t-end 10
        flexmb advise gyrostat.toml --tol 1e-2 --quantity marker:tip.position --quantity load:mount.torque
        flexmb advise gyrostat.toml --tol 1e-2 --quantity marker:tip.position@0.05 --out small.toml

    **Quantities** are `marker:NAME.position`, `.orientation`, `.velocity`, `.angular_velocity`, `load:HINGE.torque`,
    `.force`, `wheel_load:WHEEL.torque`, `drive:NAME`, `energy.total`, `momentum.angular`, patterns such as
    `marker:*.position`, and prefixes such as `energy`. Errors are relative to the range of the signal, or to the scale
    after @, in SI units.

    **Exit code**: 0 advised, 1 no model known to be adequate, 2 the scene or an option is wrong.
    """
    with no_traceback():
        from flexmb.advisor.advice import advise as search
        from flexmb.advisor.advice_tables import advice_tables
        from flexmb.scene.files import load_scene, save_scene

        loaded = load_scene(scene)
        check_folder(out.parent)
        with console.status(Text(f"trying models of {scene} (the first run after an update compiles)")):
            advice = search(loaded, tol, quantity, t_end, budget)
        console.print(advice_tables(advice, trials))
        if advice.scene is None or advice.method is None:
            raise typer.Exit(EXIT_STOPPED)
        folder(out.parent)
        save_scene(advice.scene, out)
    console.print("wrote", str(out), soft_wrap=True)
    console.print(f"flexmb simulate {out} --t-end {t_end:g} {advice.method.words()}", soft_wrap=True)
