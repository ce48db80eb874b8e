"""`flexmb mass`: mass properties of a scene and of its bodies with all that they carry."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated

import typer

from flexmb.cli.terminal import NoUserCode, SceneFile, console, no_traceback
from flexmb.output.listing import Listing, figures, names, prose

if TYPE_CHECKING:
    from flexmb.system.mass_properties import MassProperties


def mass(
    scene: SceneFile,
    body: Annotated[
        list[str] | None,
        typer.Option(help="A body with all that it carries; may be repeated. Default: all.", show_default=False),
    ] = None,
    no_user_code: NoUserCode = False,
) -> None:
    """
    Print mass, mass centre and inertia of a scene, and of its bodies with all that they carry, at the initial state.

        flexmb mass satellite.toml
        flexmb mass satellite.toml --body panel

    Mass centre and inertia of the **scene** are in World axes, those of a **body** in its own frame. Inertia is about
    the mass centre: xx, yy, zz, xy, xz, yz. Wheels and point masses are parts of the bodies that carry them.

    **Exit code**: 0 printed, 2 the scene is wrong, or has no such body.
    """
    with no_traceback():
        from flexmb.scene.files import load_scene
        from flexmb.system.compile import compile

        system = compile(load_scene(scene))
        state = system.initial_state
        rows = [] if body else [("scene", system.mass_properties(state))]
        rows += [(name, system.mass_properties(state, name)) for name in (body or system.body_names)]
        console.print(_table(system.scene.name, rows))


_AXES = "Scene: World axes; bodies: their own frames; inertia about the mass centre."


def _table(scene: str, rows: list[tuple[str, MassProperties]]) -> Listing:
    vectors = prose("centre m", "inertia kg m²: xx, yy, zz, xy, xz, yz")
    columns = (*names("with what it carries"), *figures("mass kg"), *vectors)
    table = Listing(*columns, title=f"\nMass properties of {scene}", caption=_AXES)
    for name, found in rows:
        J = found.inertia_in_body
        six = [*J.diagonal(), J[0, 1], J[0, 2], J[1, 2]]
        table.add(name, f"{found.mass:.6g}", _numbers(found.centre_in_body), _numbers(six))
    return table


def _numbers(values: Iterable[float]) -> str:
    """Numbers with six digits; those that are rounding errors of the largest are printed as zero."""
    numbers = [float(value) for value in values]
    largest = max(map(abs, numbers))
    kept = [0.0 if abs(value) < 1e-14 * largest else value for value in numbers]
    return ", ".join(f"{value:.6g}" for value in kept)
