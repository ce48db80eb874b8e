"""`crosscheck manufacture`: a case whose exact answer is known, of any scene."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from crosscheck.cli.common import NoUserCode, app, console, in_one_line
from crosscheck.terminal.text import words


@app.command()
def manufacture(
    scene: Annotated[Path, typer.Argument(help="A scene file.", exists=True, dir_okay=False)],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the case, which must be empty or new.")],
    seed: Annotated[int, typer.Option(min=0, help="Seed of the motion.")] = 0,
    duration: Annotated[float, typer.Option(min=1e-9, max=1e9, metavar="SECONDS", help="How long it moves.")] = 1.0,
    amplitude: Annotated[
        float, typer.Option(min=1e-6, max=3.0, help="Size of angles, rad, and of displacements over the bodies' size.")
    ] = 0.3,
    no_user_code: NoUserCode = False,
) -> None:
    """
    Make a case of a scene with a motion that is known exactly.

    All coordinates follow sines drawn by `--seed`, from the scene's initial values. The motors of hinges, point masses
    and wheels, and the forces and moments at nodes of flexible or free bodies, that make this motion exact come from
    the dense route, which shares no algorithm with what it judges. They replace the scene's own motors; its loads,
    springs, connectors and prescribed motions stay. `crosscheck run OUT` then holds every engine that takes the scene
    against the motion and the loads of all joints. `docs/manufactured.md` tells more.

    **Refused**: controllers, events, forces that are not smooth along the motion, modes that loads at nodes cannot
    drive. Loads of couplings are not among the channels.

    **Exit code**: 0 the case is written; 1 there is no such motion; 2 the request makes no sense.

    **Examples**: `crosscheck manufacture scene.toml --seed 5 --out my/case` · `crosscheck run my/case`
    """
    with in_one_line():
        from crosscheck.manufacture.case import write_case
        from crosscheck.manufacture.drives import manufacture as make
        from flexmb.scene.check import check_scene
        from flexmb.scene.files import load_scene

        read = load_scene(scene)
        check_scene(read)
        made = make(read, seed, duration, amplitude)
        given = ["crosscheck", "manufacture", scene.name, "--seed", str(seed), "--duration", repr(duration)]
        command = shlex.join([*given, "--amplitude", repr(amplitude), "--out", out.name])
        engines = write_case(made, out, command, seed)
    console.print(words(f"{out}: loads in tables of {made.interval_s:.3g} s, for {', '.join(engines)}", "green"))
