"""`flexmb check` and `flexmb schema`: scenes as files."""

from __future__ import annotations

import warnings
from typing import Annotated

import typer
from rich.text import Text

from flexmb.cli.terminal import NoUserCode, SceneFile, Strict, console, no_traceback
from flexmb.output.printable import printable

End = Annotated[float | None, typer.Option("--t-end", help="End of the run in s, which functions must cover.")]


def check(scene: SceneFile, t_end: End = None, strict: Strict = False, no_user_code: NoUserCode = False) -> None:
    """
    Check a scene without running it: every defect with its place and its remedy.

    What is sound compiles, closes its loops and has accelerations at its start.

        flexmb check boom.toml --t-end 60
        flexmb check boom.toml --strict

    Doubtful values, which usually result from an error of units, cause warnings on stderr. A scene declares them as
    intended under `allow`.

    **Exit code**: 0 sound, 2 wrong, or with `--strict` doubtful.
    """
    with no_traceback(strict):
        from flexmb.scene.bodies import BeamBody
        from flexmb.scene.files import load_scene
        from flexmb.scene.loaded import called
        from flexmb.scene.problems import SceneWarning, in_short
        from flexmb.scene.strains import in_words
        from flexmb.system.starting import check_scene

        loaded = load_scene(scene)
        if doubts := check_scene(loaded, t_end):
            warnings.warn(in_short(called(loaded), doubts), SceneWarning, stacklevel=2)
    counts = ", ".join(
        f"{len(getattr(loaded, key))} {key.replace('_', ' ')}" for key in ("bodies", "hinges", "markers")
    )
    console.print(Text.assemble(("sound", "green"), printable(f": {loaded.name} ({counts})")))
    for body in loaded.bodies:
        if isinstance(body, BeamBody) and body.level != "rigid":
            from flexmb.system.few_modes import idle  # imported here because a scene with defects needs no compiler

            words = in_words(body)
            if without := ", ".join(idle(body)):
                words += f"; none of its {body.modes.count} modes: {without}"
            console.print(printable(f'  beam "{body.name}", {body.level}: {words}'), soft_wrap=True)


def schema() -> None:
    """
    Print the JSON Schema of scene files.

    Point your editor's TOML or JSON language server at it for completion and inline errors:

        flexmb schema > scene.schema.json
    """
    from flexmb.scene.reference import json_schema

    print(json_schema())
