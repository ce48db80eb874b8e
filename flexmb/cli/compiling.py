"""`flexmb warmup`: compile the special kernels of scenes in advance."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flexmb.cli.terminal import NoUserCode, console, no_traceback


def warmup(
    scenes: Annotated[
        list[Path] | None,
        typer.Argument(help="Scene files; without any, general kernels if they are not installed.", metavar="SCENE"),
    ] = None,
    method: Annotated[
        list[str] | None, typer.Option(help="In addition to `dop853`, `rk4`; may be repeated.", show_default=False)
    ] = None,
    algorithm: Annotated[
        list[str] | None, typer.Option(help="In addition to `articulated`; may be repeated.", show_default=False)
    ] = None,
    every: Annotated[
        bool, typer.Option("--all", help="All general kernels that did not come with the installation.")
    ] = False,
    no_user_code: NoUserCode = False,
) -> None:
    """
    Compile the special kernels of scenes in advance; they contain only what these scenes need, and are faster.

        flexmb warmup robot.toml
        flexmb warmup robot.toml --method radau5

    From then on all runs of scenes with the same features use them, unless general kernels are requested
    (`FLEXMB_KERNELS=general`, or `flexmb.compile(scene, kernels="general")`).

        flexmb warmup --all

    compiles all general kernels that an installation from a checkout leaves for later, in some minutes.

    **Exit code**: 0 compiled, 2 a scene is wrong, or a name does not exist.
    """
    with no_traceback():
        if every:
            _refuse_beside_all(scenes, method, algorithm)
            from flexmb.ready.make import at_a_time, make_the_rest

            console.print(f"Compiled, kept in {make_the_rest(at_a_time())}.", highlight=False, soft_wrap=True)
            return
        from flexmb.jit.folder import cache_directory
        from flexmb.run.warm_up import warm_up
        from flexmb.scene.files import load_scene

        seconds = warm_up(
            ("dop853", "rk4", *(method or ())),  # type: ignore[arg-type]  # names are checked there
            ("articulated", *(algorithm or ())),  # type: ignore[arg-type]
            [load_scene(path) for path in scenes or ()] or ["tree"],
        )
        where = cache_directory() or "memory only: no folder is writable"
        console.print(f"Compiled in {seconds:.1f} s, kept in {where}.", highlight=False, soft_wrap=True)


def _refuse_beside_all(*others: object) -> None:
    """ValueError: general kernels are for every scene, method and algorithm."""
    if any(others):
        raise ValueError("--all compiles general kernels, for every scene, method and algorithm: name none beside it")
