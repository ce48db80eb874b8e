"""Any model of another program as a scene, by the ending of its file."""

from __future__ import annotations

import os
from pathlib import Path

from flexmb.interchange.imported import ImportedScene, ModelError, naming
from flexmb.scene.bodies import ModalBody
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene

SID = (".sid", ".sid_fem")
MJCF = (".xml", ".mjcf")
URDF = ".urdf"
ENDINGS = (URDF, *MJCF, *SID)


def read_model(
    path: str | os.PathLike[str], free_base: bool = False, repair: bool = False,
    stop_stiffness: float | None = None, smoothing: float | None = None,
) -> ImportedScene:  # fmt: skip
    """The scene of a URDF, an MJCF or a SID file, which are read as `read_urdf`, `read_mjcf` and `imported_sid` do.

    The body of a SID file is `held`. Raises ModelError also for another ending, and for options that the kind of file
    does not have.
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending == URDF:
        from flexmb.interchange.urdf import read_urdf

        return read_urdf(path, free_base=free_base, repair=repair, stop_stiffness=stop_stiffness, smoothing=smoothing)
    if free_base:
        raise ModelError("--free-base is for URDF: an MJCF has a freejoint, and a SID file's body is joined in a scene")
    if ending in MJCF:
        if repair:
            raise ModelError("--repair is for URDF and SID: MuJoCo, which compiles an MJCF, has its own checks")
        from flexmb.interchange.mjcf import read_mjcf

        return read_mjcf(path, stop_stiffness=stop_stiffness, smoothing=smoothing)
    if stop_stiffness is not None or smoothing is not None:
        raise ModelError("--stop-stiffness and --smoothing are for URDF and MJCF: other files have no joints")
    if ending in SID:
        from flexmb.interchange.sid import imported_sid, read_sid

        imported = imported_sid(read_sid(path), path.stem, repair=repair)
        with naming(str(path)):
            return ImportedScene(held(imported.body), imported.notes)
    raise ModelError(f'{path}: "{path.suffix}" is not a known kind of model: give .urdf, .xml (MJCF) or .sid')


def held(body: ModalBody) -> Scene:
    """The body welded to the ground at its body frame, or at its first node if no material is fixed to that."""
    node = body.nodes[0].name if body.nodes and body.boundary == "free-free" else "origin"
    return SceneBuilder(body.name).add(body).weld("base", "ground", body.name, child_node=node).scene()
