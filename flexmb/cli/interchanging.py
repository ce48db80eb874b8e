"""`flexmb import`, `flexmb export` and `flexmb reduce`: models from other programs, and bodies for them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.text import Text

from flexmb.cli.terminal import NoUserCode, SceneFile, console, errors, no_traceback
from flexmb.output.printable import printable
from flexmb.output.writing import check_folder, folder

if TYPE_CHECKING:
    from flexmb.scene.schema import Scene

SHOWN = 10  # modes of a reduced body that are shown beside those of the structure
Out = Annotated[Path, typer.Option("--out", "-o", help="File to write.", show_default=False)]


def import_(
    model: Annotated[Path, typer.Argument(help="URDF, MJCF (.xml) or SID file.", metavar="MODEL", show_default=False)],
    out: Annotated[Path, typer.Option("--out", "-o", help="Scene file to write.")] = Path("scene.toml"),
    free_base: Annotated[bool, typer.Option("--free-base", help="URDF: the root link is free.")] = False,
    repair: Annotated[
        bool,
        typer.Option("--repair", help="URDF, SID: change impossible inertia tensors by the least amount."),
    ] = False,
    stop_stiffness: Annotated[
        float | None, typer.Option(help="URDF, MJCF: limits become stops, of N m/rad or N/m.", show_default=False)
    ] = None,
    smoothing: Annotated[
        float | None,
        typer.Option(help="URDF, MJCF: dry friction, smooth below this rate (rad/s or m/s).", show_default=False),
    ] = None,
) -> None:
    """
    Convert a robot (URDF, MJCF) or a flexible body (SID) to a scene.

    Notes list what the scene omits of the model. A SID body is welded to the ground at its body frame, or at its first
    node if no material is fixed to the frame.

    **Examples**

        flexmb import robot.urdf --out robot.toml
        flexmb import quadruped.urdf --free-base
        flexmb import humanoid.xml --stop-stiffness 1e4 --smoothing 1e-3
        flexmb import panel.sid --out panel.toml

    **Exit code**: 0 written, 2 the model cannot be a scene: the message names the place and the remedy.
    """
    with no_traceback():
        from flexmb.interchange.models import read_model

        check_folder(out.parent)
        found = read_model(model, free_base, repair, stop_stiffness, smoothing)
        _write(found.scene, out, found.notes)


def export(
    scene: SceneFile,
    body: Annotated[str, typer.Argument(help="Name of a flexible body.", metavar="BODY", show_default=False)],
    out: Out,
    dialect: Annotated[
        Literal["wallrapp", "fembs"],
        typer.Option(help="wallrapp: J 3 x 3, columns of Gr and Ge by mode; fembs: J 6 x 1, columns by axis."),
    ] = "wallrapp",
    no_user_code: NoUserCode = False,
) -> None:
    """
    Write a flexible body of a scene (beam, modal or SID) as a SID file, all blocks to first order.

        flexmb export boom.toml strip --out strip.sid
        flexmb export boom.toml strip --out strip.SID_FEM --dialect fembs

    **Exit code**: 0 written, 2 the scene or the body is wrong.
    """
    with no_traceback():
        from flexmb.interchange.sid import sid_of, with_sid_bodies, write_sid
        from flexmb.scene.bodies import BeamBody, ModalBody
        from flexmb.scene.check import check_and_warn
        from flexmb.scene.files import load_scene
        from flexmb.scene.problems import closest

        loaded = load_scene(scene)
        check_and_warn(loaded)
        check_folder(out.parent)
        flexible = {
            body.name: body for body in with_sid_bodies(loaded).bodies if isinstance(body, BeamBody | ModalBody)
        }
        if body not in flexible:
            raise ValueError(f'"{body}" is not a flexible body of the scene: {closest(body, flexible)}')
        folder(out.parent)
        write_sid(sid_of(flexible[body]), out, dialect)
    console.print("wrote", str(out), soft_wrap=True)


def reduce(
    stiffness: Annotated[
        Path, typer.Argument(help="K: .mtx, .sti, .hb, .matrix, .op4 or .pch.", metavar="K", show_default=False)
    ],
    mass: Annotated[Path, typer.Argument(help="M, or the file of K again.", metavar="M", show_default=False)],
    nodes: Annotated[
        Path, typer.Argument(help="CSV: id,x,y,z[,dofs]; .inp or .bdf.", metavar="NODES", show_default=False)
    ],
    interface: Annotated[
        str, typer.Option(help="Numbers of the interface nodes, for hinges, loads and markers.", show_default=False)
    ],
    out: Out,
    modes: Annotated[int, typer.Option(help="Number of fixed-interface modes.")] = 8,
    free: Annotated[bool, typer.Option("--free", help="Free-free modes about the mass centre.")] = False,
    damping: Annotated[float, typer.Option(help="Damping ratio of every mode.")] = 0.0,
    rigid: Annotated[
        list[str] | None,
        typer.Option(help="Tie a surface rigidly (RBE2) to a new node: 900=1-20,31 or 900@X,Y,Z=1-20."),
    ] = None,
    mean: Annotated[
        list[str] | None, typer.Option(help="The same, with the surface's mean motion (RBE3); it stays flexible.")
    ] = None,
    attach: Annotated[
        str, typer.Option(help="Numbers of further nodes that get static modes, for loads and markers.")
    ] = "",
) -> None:
    """
    Reduce finite-element matrices to a flexible body (Craig and Bampton): a SID file, or a scene with the body.

    Without `--free` the first interface node is the body's frame, at which the modes are clamped.

    **Examples**

        flexmb reduce K.mtx M.mtx nodes.csv --interface 1,12 --modes 8 --out panel.sid
        flexmb reduce panel.pch panel.pch panel.bdf --interface 101 --free --damping 0.005 --out panel.toml
        flexmb reduce b.sti b.mas b.inp --rigid 900=1-20 --mean 901=81-100 --interface 900,901 --out b.toml

    **Exit code**: 0 written, 2 the matrices are not those of a free structure, or do not fit the nodes.
    """
    with no_traceback():
        import numpy as np

        from flexmb.cli.numbers_of_nodes import numbers_of, tie_of
        from flexmb.interchange.models import SID, held
        from flexmb.interchange.sid import sid_of, write_sid
        from flexmb.interchange.superelement import compared, interface_of, read_super_element, reduced

        check_folder(out.parent)
        if out.suffix.lower() not in (*SID, ".toml"):
            raise ValueError(f'--out: "{out.suffix}" is neither a SID file (.sid) nor a scene (.toml)')
        chosen, further = numbers_of("--interface", interface), numbers_of("--attach", attach) if attach else []
        ties = [*(tie_of("rigid", word) for word in rigid or ()), *(tie_of("mean", word) for word in mean or ())]
        structure = read_super_element(stiffness, mass, nodes)
        made = reduced(
            structure, interface_of(structure, chosen, ties), modes, name=out.stem,
            boundary="free-free" if free else "clamped-free", damping_ratio=damping, attached=further,
        )  # fmt: skip
        centre, moments = (
            " ".join(f"{component:.6g}" for component in row) for row in (made.centre, np.diag(made.inertia))
        )
        console.print(f"mass {made.mass:.6g} kg, centre {centre} m, moments of inertia {moments} kg m²")
        console.print(
            "frequencies", " ".join(f"{frequency:.6g}" for frequency in made.frequencies), "Hz", soft_wrap=True
        )
        console.print("mode  given Hz      reduced Hz    off       MAC", soft_wrap=True)
        for number, (own, given, mac) in enumerate(zip(*compared(structure, made, SHOWN), strict=True), 1):
            row = f"{number:4d}  {given:<12.6g}  {own:<12.6g}  {own / given - 1.0:<8.1g}  {mac:.4f}"
            console.print(row, soft_wrap=True, highlight=False)
        if out.suffix.lower() == ".toml":
            _write(held(made.body), out, made.notes)
            return
        _tell(made.notes)
        folder(out.parent)
        write_sid(sid_of(made.body), out)
    console.print("wrote", str(out), soft_wrap=True)


def _write(scene: Scene, out: Path, notes: tuple[str, ...]) -> None:
    from flexmb.scene.files import save_scene

    _tell(notes)
    folder(out.parent)
    save_scene(scene, out)
    console.print("wrote", str(out), soft_wrap=True)


def _tell(notes: tuple[str, ...]) -> None:
    for note in notes:
        errors.print(Text("note: ", style="bold yellow") + Text(printable(note)), soft_wrap=True)
