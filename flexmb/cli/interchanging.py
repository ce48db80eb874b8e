"""`flexmb import`, `flexmb export` and `flexmb reduce`: models from other programs, and bodies for them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.text import Text

from flexmb.cli.terminal import NoUserCode, SceneFile, console, errors, no_traceback
from flexmb.output.files import check_folder, folder
from flexmb.output.printable import printable

if TYPE_CHECKING:
    from flexmb.export.model import ExportedModel
    from flexmb.interchange.superelement import Tie
    from flexmb.scene.schema import Scene


ONLY = "--input and --derivatives are for --fmu and --c, --fmi and --step for --fmu; --page takes --input and --step"
MANY = 8_000  # nodes in a range: more than a structure can have


def numbers_of(option: str, words: str) -> list[int]:
    """Numbers of nodes; ValueError, which names the option."""
    numbers = list[int]()
    for word in words.split(","):
        first, to, last = word.partition("-")
        try:
            start, stop = int(first), int(last if to else first)
        except ValueError:
            raise ValueError(f"{option} is numbers of nodes such as 1,12 or 1-20; got {words!r}") from None
        if not 0 <= stop - start < MANY:
            raise ValueError(f"{option}: {word} is not a range of at most {MANY} nodes, from the lower to the higher")
        numbers += range(start, stop + 1)
    return numbers


def tie_of(kind: Literal["rigid", "mean"], words: str) -> Tie:
    """A surface and the node that it is tied to; ValueError, which names the option."""
    from flexmb.interchange.superelement import Tie

    head, _, surface = words.partition("=")
    node, at, place = head.partition("@")
    try:
        x, y, z = map(float, place.split(",")) if at else (0.0, 0.0, 0.0)
        number = int(node)
    except ValueError:
        raise ValueError(f"--{kind} is a new node and its surface, 900=1-20 or 900@X,Y,Z=1-20; got {words!r}") from None
    return Tie(number, tuple(numbers_of(f"--{kind}", surface)), kind, (x, y, z) if at else None)


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
    body: Annotated[
        str | None, typer.Argument(help="Name of a flexible body, for --out.", metavar="[BODY]", show_default=False)
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="SID file of the body.", show_default=False)] = None,
    dialect: Annotated[
        Literal["wallrapp", "fembs"],
        typer.Option(help="wallrapp: J 3 x 3, columns of Gr and Ge by mode; fembs: J 6 x 1, columns by axis."),
    ] = "wallrapp",
    fmu: Annotated[Path | None, typer.Option(help="Write the scene as an FMU.", show_default=False)] = None,
    c: Annotated[
        Path | None, typer.Option("--c", help="Folder for the scene as C, with one header.", show_default=False)
    ] = None,
    inputs: Annotated[
        list[str] | None,
        typer.Option(
            "--input", help="Not --out: a load (NAME.function), motor or actuator as input.", show_default=False
        ),
    ] = None,
    step: Annotated[
        float | None,
        typer.Option(help="--fmu: Co-Simulation too, in equal steps (s); --page: its steps.", show_default=False),
    ] = None,
    target: Annotated[
        str | None, typer.Option(help="--c: processors, x86-64-v3 unless given; see below.", show_default=False)
    ] = None,
    page: Annotated[
        Path | None, typer.Option(help="Write a page (.html) that computes the scene.", show_default=False)
    ] = None,
    sliders: Annotated[
        list[str] | None,
        typer.Option("--slider", help="--page: a number to change, NAME or NAME=LOW,HIGH.", show_default=False),
    ] = None,
    fmi: Annotated[Literal["2", "3"], typer.Option("--fmi", help="--fmu: FMI 2.0 or 3.0.")] = "2",
    derivatives: Annotated[
        bool, typer.Option("--derivatives", help="--fmu, --c: with derivatives by states and inputs; compiles longer.")
    ] = False,
    no_user_code: NoUserCode = False,
) -> None:
    """
    Write a flexible body of a scene (beam, modal or SID) as a SID file, all blocks to first order.

        flexmb export boom.toml strip --out strip.sid
        flexmb export boom.toml strip --out strip.SID_FEM --dialect fembs

    Or write the whole scene as a program that needs no Python: an FMU for other simulation tools on Linux on x86-64,
    which takes a C compiler; C for one's own program on x86-64-v3, aarch64, armv7, cortex-m7, riscv64 or wasm32; or a
    page that computes its motion in the browser, which takes the extra flexmb[web]: see docs/export-fmu.md.

        flexmb export arm.toml --fmu arm.fmu --input shoulder.rotation.torque_Nm --step 1e-4
        flexmb export arm.toml --c arm --target cortex-m7
        flexmb export array.toml --page array.html --slider hinge.rotation.damping_Nms_rad=0,5

    **Exit code**: 0 written, 2 the scene or the body is wrong, or is not exported: the message has the remedy.
    """
    with no_traceback():
        if ((inputs or derivatives) and out is not None) or (step is not None and fmu is None and page is None):
            raise ValueError(ONLY)
        if (target is not None and c is None) or (sliders and page is None) or (derivatives and page is not None):
            raise ValueError("--target is for --c, --slider for --page, --derivatives are for --fmu and --c")
        if fmi != "2" and fmu is None:
            raise ValueError(ONLY)
        if sum(place is not None for place in (out, fmu, c, page)) != 1:
            raise ValueError("give one of --out FILE (with a BODY), --fmu FILE, --c FOLDER and --page FILE")
        if (body is None) != (out is None):
            raise ValueError("a BODY is written by --out FILE; the others write the whole scene, without a BODY")
        if body is not None and out is not None:
            _export_body(scene, body, out, dialect)
            return
        from flexmb.export.emitted import LEVEL
        from flexmb.export.web import export_page
        from flexmb.export.writing import export_c, export_fmu

        asked = tuple(inputs or ())
        if fmu is not None:
            write = partial(export_fmu, path=fmu, inputs=asked, step=step, derivatives=derivatives, fmi=fmi)
            _export_program(scene, fmu, fmu.parent, write)
        elif page is not None:
            ranges = dict(map(_slider, sliders or ())) or None
            write = partial(export_page, path=page, sliders=ranges, inputs=asked, step=step)
            _export_program(scene, page, page.parent, write)
        elif c is not None:
            write = partial(export_c, folder=c, inputs=asked, derivatives=derivatives, target=target or LEVEL)
            _export_program(scene, c, c, write)


def _export_body(scene: Path, body: str, out: Path, dialect: Literal["wallrapp", "fembs"]) -> None:
    from flexmb.interchange.sid import sid_of, with_sid_bodies, write_sid
    from flexmb.scene.bodies import BeamBody, ModalBody
    from flexmb.scene.check import check_and_warn
    from flexmb.scene.files import load_scene
    from flexmb.scene.problems import closest

    loaded = load_scene(scene)
    check_and_warn(loaded)
    check_folder(out.parent)
    flexible = {body.name: body for body in with_sid_bodies(loaded).bodies if isinstance(body, BeamBody | ModalBody)}
    if body not in flexible:
        raise ValueError(f'"{body}" is not a flexible body of the scene: {closest(body, flexible)}')
    folder(out.parent)
    write_sid(sid_of(flexible[body]), out, dialect)
    console.print("wrote", str(out), soft_wrap=True)


def _export_program(scene: Path, place: Path, where: Path, write: Callable[[Scene], ExportedModel]) -> None:
    """Write a scene to a place in the folder `where`, and say what it can change."""
    from flexmb.scene.files import load_scene

    loaded = load_scene(scene)
    check_folder(where)
    folder(where)
    with console.status(Text(f"compiling {scene}")):
        model = write(loaded)
    numbers = model.numbers.changeable
    for what, names in (
        ("inputs", [each.candidate.name for each in numbers if each.candidate.is_input]),
        ("parameters", [each.candidate.name for each in numbers if not each.candidate.is_input]),
    ):
        console.print(printable(f"{what}: {', '.join(names) or 'none'}"), soft_wrap=True)
    _tell(tuple(f"{name} is fixed: {why}" for name, why in model.numbers.fixed.items()))
    _tell((model.open_loads,) if model.open_loads else ())
    console.print("wrote", str(place), soft_wrap=True)


def _slider(text: str) -> tuple[str, tuple[float, float] | None]:
    """Name and range of NAME or NAME=LOW,HIGH."""
    name, given, between = text.partition("=")
    if not given:
        return name, None
    try:
        low, high = map(float, between.split(","))
    except ValueError:
        raise ValueError(f'--slider "{text}": give NAME or NAME=LOW,HIGH, two numbers') from None
    return name, (low, high)


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
