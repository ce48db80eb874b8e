"""Cases exported for the tests of this folder, and changes of what was exported."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from crosscheck.export.archive import archive, write_archive
from crosscheck.library.find import load_case, shipped_folder
from crosscheck.library.reference import load_reference
from crosscheck.running.plan import variant_scene
from flexmb.scene.schema import Scene

Data = dict[str, Any]
HELD = "model.json"


def export_cases(out: Path, *names: str) -> Path:
    """The archive of some cases, in a folder."""
    write_archive(archive([load_case(shipped_folder() / name) for name in names]), out)
    return out


def scene_of(name: str) -> Scene:
    """The scene of a case's reference, after its transformation."""
    case = load_case(shipped_folder() / name)
    variant = case.run.variant(load_reference(case.folder).knowledge.variant)
    return variant_scene(case.scene(variant), variant)


def change(folder: Path, edit: Callable[[Data], None], file: str = HELD) -> None:
    """Change a file of an exported case."""
    data = json.loads((folder / file).read_text(encoding="utf-8"))
    edit(data)
    (folder / file).write_text(json.dumps(data), encoding="utf-8")


