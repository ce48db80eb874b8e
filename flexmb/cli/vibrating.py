"""`flexmb vibrate`: modes by which the ground takes part, and responses to its random vibration."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from flexmb.cli.terminal import NoUserCode, SceneFile, console, no_traceback
from flexmb.output.files import check_folder

if TYPE_CHECKING:
    from flexmb.linear.base_excitation import BaseExcitation
    from flexmb.linear.random_response import RandomResponse, SpectralDensity


def vibrate(
    scene: SceneFile,
    density: Annotated[
        str | None,
        typer.Option(
            help="Spectral density of the ground's acceleration: `Hz:value,Hz:value,...`, straight between points in "
            "logarithmic scales.",
            show_default=False,
        ),
    ] = None,
    axis: Annotated[str, typer.Option(help="Axis of World along which the ground is shaken: `x`, `y` or `z`.")] = "z",
    unit: Annotated[str, typer.Option(help="Of the density: `g` for g²/Hz, `si` for (m/s²)²/Hz.")] = "g",
    at: Annotated[str, typer.Option(help="`equilibrium` found from the initial state, or the `initial` state.")] = (
        "equilibrium"
    ),
    outputs: Annotated[
        list[str] | None,
        typer.Option(
            "--output", help="Output to list, or a pattern such as `load:*`; may be repeated.", show_default=False
        ),
    ] = None,  # fmt: skip
    picture: Annotated[Path, typer.Option("--picture", "-o", help="Picture of the densities.")] = (
        Path("out/vibration.png")
    ),
    csv: Annotated[Path | None, typer.Option(help="File for the densities.", show_default=False)] = None,
    no_user_code: NoUserCode = False,
) -> None:
    """
    Shake the ground on which a scene stands: effective masses of its modes, and RMS of what random vibration does.

    Without `--density` the modes are listed: frequency, damping ratio, and the effective mass of each along x, y, z and
    about them, as shares of all that stands on the ground.

    **Examples**

        flexmb vibrate mast.toml
        flexmb vibrate mast.toml --axis x --density 20:0.01,80:0.04,350:0.04,2000:0.007
        flexmb vibrate mast.toml --density 5:1,100:1 --unit si --output 'load:root.*' --csv root.csv

    **Listed** are RMS values and how often a second a signal rises through its mean. Places, rotations and velocities
    are relative to the ground, accelerations absolute; loads are changes of those at rest.

    **Exit code**: 0 computed, 1 no equilibrium was found, 2 the scene or an option is wrong.
    """
    with no_traceback():
        from flexmb.linear.linear_tables import base_modes_table, random_table

        if at not in ("equilibrium", "initial"):
            raise ValueError(f"--at is equilibrium or initial, not {at!r}")
        if axis not in ("x", "y", "z"):
            raise ValueError(f"--axis is x, y or z, not {axis!r}")
        given = None if density is None else _density(density, unit)
        if given is not None:
            for file in (picture, *([] if csv is None else [csv])):
                check_folder(file.parent)
        with console.status(Text(f"linearising {scene} (the first time after an update compiles)")):
            excitation = _excitation(scene, at)
        if given is None:
            console.print(base_modes_table(excitation))
            return
        response = _response(excitation, axis, given, outputs or [])
        console.print(random_table(response))
        written = [response.plot(picture), *([] if csv is None else [response.to_csv(csv)])]
    console.print("wrote", ", ".join(str(path) for path in written), soft_wrap=True)


def _density(text: str, unit: str) -> SpectralDensity:
    from flexmb.linear.random_response import SpectralDensity

    if unit not in ("g", "si"):
        raise ValueError(f"--unit is g or si, not {unit!r}")
    try:
        points = [tuple(float(word) for word in pair.split(":")) for pair in text.split(",")]
    except ValueError:
        points = []
    if not points or any(len(point) != 2 for point in points):
        raise ValueError(f"--density is Hz:value,Hz:value,..., such as 20:0.01,2000:0.01; got {text!r:.80}")
    return SpectralDensity.in_g(points) if unit == "g" else SpectralDensity.of(points)


def _excitation(scene: Path, at: str) -> BaseExcitation:
    from flexmb.linear.base_excitation import base_excitation
    from flexmb.linear.equations import built
    from flexmb.linear.equilibrium import equilibrium
    from flexmb.scene.files import load_scene

    system = built(load_scene(scene))
    if at == "initial":
        return base_excitation(system)
    return base_excitation(system, equilibrium(system), held=True)


def _response(excitation: BaseExcitation, axis: str, density: SpectralDensity, patterns: list[str]) -> RandomResponse:
    from fnmatch import fnmatchcase

    from flexmb.linear.random_response import random_response

    names = [name for name, _ in excitation.model.outputs]
    chosen = tuple(name for name in names if any(fnmatchcase(name, pattern) for pattern in patterns))
    if patterns and not chosen:
        raise ValueError(f"--output {', '.join(patterns)} fits none of {', '.join(names)}")
    return random_response(excitation.model, {f"base.{axis}": density}, chosen)
