"""`flexmb equivalence`: modes compared with a rigid body on a spring hinge."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import Annotated

import typer

from flexmb.cli.terminal import NoUserCode, SceneFile, console, no_traceback, vector
from flexmb.output.files import check_folder


def equivalence(
    scene: SceneFile,
    body: Annotated[str, typer.Argument(help="Name of the flexible body.", metavar="BODY", show_default=False)],
    accuracy: Annotated[float, typer.Option(help="Relative difference that counts as equal, such as 0.05.")] = 0.05,
    modes: Annotated[
        int | None, typer.Option(help="Number of modes; by default all accurate ones.", show_default=False)
    ] = None,
    axis: Annotated[
        list[str] | None,
        typer.Option(help="Hinge axis, `y` or `0,0.6,0.8`, body axes; may be repeated for two or three axes."),
    ] = None,
    mode: Annotated[
        list[int] | None, typer.Option(help="Mode that the hinge replaces, from 1; one for each axis.")
    ] = None,
    point: Annotated[
        str | None, typer.Option(help="A further hinge, m from the clamp: `0.4,0,0`.", show_default=False)
    ] = None,
    angle: Annotated[float, typer.Option(help="Hinge angle in rad for the displacement forms (47), (49).")] = 0.1,
    picture: Annotated[Path, typer.Option("--picture", "-o", help="Picture file.")] = Path("out/equivalence.png"),
    no_user_code: NoUserCode = False,
) -> None:
    """
    Compare two models of an appendage, modes and a rigid body on a spring hinge; print tables, write a picture.

    The appendage is a flexible body that carries nothing and is clamped at its hinge. The tables have the differences
    in Frisch's three equivalence relations, the best hinge and its spring, the number of modes that are needed, and
    which model is better for which question.

    **Examples**

        flexmb equivalence gyrostat.toml panel
        flexmb equivalence gyrostat.toml panel --axis y --axis z --accuracy 0.01 --modes 20
        flexmb equivalence gyrostat.toml panel --point 0.5,0,0 --picture panel.png

    **Exit code**: 0 compared, 2 the scene, the body or an option is wrong.
    """
    with no_traceback():
        if not isfinite(angle):
            raise ValueError(f"--angle is {angle}: give a finite number")
        from flexmb.frisch.equivalence.appendage import appendage_of
        from flexmb.frisch.equivalence.comparison import equivalence as compare
        from flexmb.frisch.equivalence.equivalence_picture import write_equivalence_plot
        from flexmb.frisch.equivalence.equivalence_tables import equivalence_tables
        from flexmb.scene.check import check_and_warn
        from flexmb.scene.files import load_scene

        loaded = load_scene(scene)
        check_and_warn(loaded)
        check_folder(picture.parent)
        result = compare(
            appendage_of(loaded, body, modes),
            accuracy=accuracy,
            axes=[vector("axis", word) for word in axis] if axis else None,
            modes=tuple(number - 1 for number in mode) if mode else None,
            point=None if point is None else vector("point", point),
        )
        console.print(equivalence_tables(result, angle))
        written = write_equivalence_plot(result, picture)
    console.print("wrote", str(written), soft_wrap=True)
