"""`flexmb check` and `flexmb schema`: scenes as files."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.text import Text

from flexmb.cli.terminal import SceneFile, console, no_traceback
from flexmb.output.printable import printable
from flexmb.scene.check import check_scene
from flexmb.scene.files import load_scene
from flexmb.scene.reference import json_schema

End = Annotated[float | None, typer.Option("--t-end", help="Check that profiles cover the run up to here, in s.")]


def check(scene: SceneFile, t_end: End = None) -> None:
    """
    Check a scene without running it: every defect with its place and its remedy.

        flexmb check boom.toml --t-end 60

    **Exit code**: 0 sound, 2 wrong.
    """
    with no_traceback():
        loaded = load_scene(scene)
        check_scene(loaded, t_end)
    counts = ", ".join(
        f"{len(getattr(loaded, key))} {key.replace('_', ' ')}" for key in ("bodies", "hinges", "markers")
    )
    console.print(Text.assemble(("sound", "green"), printable(f": {loaded.name} ({counts})")))


def schema() -> None:
    """
    Print the JSON Schema of scene files.

    Point your editor's TOML or JSON language server at it for completion and inline errors:

        flexmb schema > scene.schema.json
    """
    print(json_schema())
