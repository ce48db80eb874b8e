"""docs/motions.md: how some cases move, as pictures that move in every browser and on every page that shows pictures.

    python -m tests.repo.motions             # simulate all, write their pictures and the page
    python -m tests.repo.motions satellite   # draw only those anew whose names begin so

A picture is an SVG file whose lines are animated by SMIL; it needs no script. What is drawn of a scene is what a report
draws of it, seen along one direction.
"""

import sys
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

import flexmb as fm
from flexmb.run.trajectory import Trajectory
from flexmb.typing import Real
from flexmb.view.draw import draw
from flexmb.view.drawing import CarriedPoint, Drawing, DrawnWheel, Line
from flexmb.view.film import film
from tests.repo.project import ROOT

PAGE = ROOT / "docs" / "motions.md"
PICTURES = ROOT / "docs" / "pictures" / "motions"
INTRODUCTION = """# Motions

How some cases move. The pictures repeat without end; the reports of `crosscheck run` show the same in three dimensions,
for every case that is run. This page is generated: `python -m tests.repo.motions`.
"""
FRAMES, SECONDS = 60, 8.0  # of a picture, which shows the whole of its time span
WIDTH, HEIGHT, MARGIN = 560, 340, 24  # pixels at most; the margin
RIM = 24  # points of a wheel's rim
FINER = 6  # points of a bent line for each of its pieces
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#c28800", "#b8609a", "#5d6877", "#3aa0d8")
EDGES = tuple((i, i ^ bit) for bit in (4, 2, 1) for i in range(8) if not i & bit)  # of a box by its corners


class Motion(NamedTuple):
    """A case with the time to show (s), and the direction from which it is seen (deg)."""

    name: str
    case: str
    text: str
    until_s: float
    azimuth: float = 35.0
    elevation: float = 22.0


MOTIONS = (
    Motion(
        "satellite",
        "spacecraft/deploy_and_slew",
        "A satellite unfolds two flexible panels, which latch, and turns by its three wheels.",
        40.0,
        62.0,
        24.0,
    ),
    Motion(
        "bricard",
        "closed_chains/bricard",
        "Bricard's loop of six revolutes has one freedom, although counting gives none.",
        10.0,
    ),
    Motion(
        "andrews",
        "closed_chains/andrews",
        "Andrews's squeezer mechanism, a benchmark of solvers for closed chains.",
        0.03,
        -90.0,
        89.0,
    ),
    Motion("boom", "deploying_boom/flexible", "A boom of flexible members that is unfolded by motors.", 10.0),
    Motion(
        "platform",
        "connectors/sprung_platform",
        "An instrument on a platform that stands on springs and dampers.",
        10.0,
    ),
    Motion("top", "tops/lagrange", "Lagrange's heavy top nods while it precesses.", 4.0),
)


def drawn(motion: Motion) -> str:
    """The picture of a motion, simulated now."""
    scene = fm.load_scene(ROOT / "cases" / motion.case / "scene.toml")
    filmed, drawing = film(scene) or (scene, draw(scene))  # a scene whose own markers suffice needs no others
    times = np.linspace(0.0, motion.until_s, FRAMES)
    trajectory = fm.simulate(filmed, t_end=motion.until_s, samples=times, method="dop853", rtol=1e-8, atol=1e-10)
    return picture(trajectory, drawing, motion)


def picture(trajectory: Trajectory, drawing: Drawing, motion: Motion) -> str:
    """An SVG of what a drawing's markers carry along a trajectory."""
    bodies = list(dict.fromkeys(line.body for line in drawing.lines))
    colours = {body: COLOURS[number % len(COLOURS)] for number, body in enumerate(bodies)}
    curves = [(colours[line.body], _strokes(trajectory, line), line.kind) for line in drawing.lines]
    curves += [("#7c8794", [_rim(trajectory, wheel)], "wheel") for wheel in drawing.wheels]
    flat = [(colour, [_seen(stroke, motion) for stroke in strokes], kind) for colour, strokes, kind in curves]
    everything = np.concatenate([stroke.reshape(-1, 2) for _, strokes, _ in flat for stroke in strokes])
    low, size = everything.min(axis=0), np.ptp(everything, axis=0)
    factor = min((WIDTH - 2 * MARGIN) / max(size[0], 1e-9), (HEIGHT - 2 * MARGIN) / max(size[1], 1e-9))
    width, height = (round(float(factor * extent + 2 * MARGIN)) for extent in size)  # no more than what moves needs
    corner = 0.5 * (np.array([width, height]) - factor * size)
    paths = [
        _path(colour, [corner + factor * (stroke - low) for stroke in strokes], kind) for colour, strokes, kind in flat
    ]
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}">'
    style = "<style>path{fill:none;stroke-linecap:round;stroke-linejoin:round}</style>"
    ground = f'<rect width="{width}" height="{height}" rx="8" fill="#fff"/>'
    return "\n".join([head, f"<title>{motion.text}</title>", style, ground, *paths, "</svg>", ""])


def _strokes(trajectory: Trajectory, line: Line) -> list[Real]:
    """The lines (frames, points, 3) of a drawing's line, in World axes."""
    placed = np.stack([_placed(trajectory, point) for point in line.points], axis=1)
    if line.kind == "solid":
        return [placed[:, list(edge)] for edge in EDGES]
    if line.kind in ("ball", "mount"):
        return [placed[:, [i, i]] for i in range(placed.shape[1])]
    if line.kind == "beam":
        return [_bent(placed, np.stack([_turned(trajectory, point) for point in line.points], axis=1))]
    return [placed]


def _bent(points: Real, tangents: Real) -> Real:
    """Cubic Hermite curves through points (frames, points, 3) with unit tangents; straight where those are zero."""
    pieces = [points[:, :1]]
    x = np.linspace(0.0, 1.0, FINER + 1)[1:, None]
    for i in range(points.shape[1] - 1):
        p, q = points[:, None, i], points[:, None, i + 1]
        length = np.linalg.norm(q - p, axis=2, keepdims=True)
        m, n = (
            np.where(np.any(tangents[:, None, j], axis=2, keepdims=True), length * tangents[:, None, j], q - p)
            for j in (i, i + 1)
        )
        y = 1.0 - x
        pieces.append((1 + 2 * x) * y * y * p + x * y * y * m + x * x * (3 - 2 * x) * q - x * x * y * n)
    return np.concatenate(pieces, axis=1)


def _rim(trajectory: Trajectory, wheel: DrawnWheel) -> Real:
    angle = np.linspace(0.0, 2.0 * np.pi, RIM + 1)[:, None]
    axis = np.array(wheel.axis) / np.linalg.norm(wheel.axis)
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    local = np.array(wheel.centre) + wheel.radius_m * (np.cos(angle) * side + np.sin(angle) * np.cross(axis, side))
    return np.stack([_placed(trajectory, CarriedPoint(wheel.marker, tuple(each))) for each in local], axis=1)


def _placed(trajectory: Trajectory, point: CarriedPoint) -> Real:
    """A carried point (frames, 3) in World axes."""
    if not point.marker:
        return np.tile(point.offset, (len(trajectory.t), 1))
    marker = trajectory.markers[point.marker]
    return np.asarray(marker.position + _rotation(marker.quaternion).apply(point.offset))


def _turned(trajectory: Trajectory, point: CarriedPoint) -> Real:
    if not point.marker:
        return np.tile(point.tangent, (len(trajectory.t), 1))
    return np.asarray(_rotation(trajectory.markers[point.marker].quaternion).apply(point.tangent))


def _rotation(quaternions: Real) -> Rotation:
    """Of quaternions (frames, 4), scalar first."""
    return Rotation.from_quat(quaternions, scalar_first=True)


def _seen(points: Real, motion: Motion) -> Real:
    """Points (frames, points, 3) as they are seen: right and down (frames, points, 2)."""
    a, e = np.radians([motion.azimuth, motion.elevation])
    right = [np.cos(a), np.sin(a), 0.0]
    up = [-np.sin(a) * -np.sin(e), np.cos(a) * -np.sin(e), np.cos(e)]
    return points @ np.array([right, np.negative(up)]).T


def _path(colour: str, strokes: list[Real], kind: str) -> str:
    """All strokes of a line as one animated path."""
    width = {"beam": 4.0, "ball": 11.0, "mount": 6.0, "solid": 1.5, "spring": 1.5, "wheel": 1.5}.get(kind, 3.0)
    frames = ["".join(_line(stroke[frame]) for stroke in strokes) for frame in range(len(strokes[0]))]
    animate = f'<animate attributeName="d" dur="{SECONDS:g}s" repeatCount="indefinite" values="{";".join(frames)}"/>'
    return f'<path stroke="{colour}" stroke-width="{width:g}" d="{frames[0]}">{animate}</path>'


def _line(points: Real) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)


def page() -> str:
    """The text of docs/motions.md."""
    parts = [
        f"## {motion.case}\n\n![{motion.text}](pictures/motions/{motion.name}.svg)\n\n{motion.text} "
        f"{motion.until_s:g} s in {SECONDS:g} s.\n"
        for motion in MOTIONS
    ]
    return "\n".join([INTRODUCTION, *parts])


def main(names: list[str]) -> None:
    PICTURES.mkdir(exist_ok=True)
    for motion in MOTIONS:
        if not names or motion.name.startswith(tuple(names)):
            (PICTURES / f"{motion.name}.svg").write_text(drawn(motion), encoding="utf-8")
            print(motion.name, (PICTURES / f"{motion.name}.svg").stat().st_size)
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
