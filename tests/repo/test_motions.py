"""docs/motions.md and its moving pictures: all there, small, and really moving; and the first picture of the pages."""

import re
from xml.etree import ElementTree

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.view.drawing import CarriedPoint, Drawing, Line
from tests.repo import front, motions
from tests.repo.project import ROOT

LARGEST = 200_000  # bytes
SVG = "{http://www.w3.org/2000/svg}"


def frames(picture: str) -> list[list[str]]:
    """The frames of every path of a picture."""
    paths = ElementTree.fromstring(picture).iter(f"{SVG}animate")
    return [path.get("values", "").split(";") for path in paths]


def test_every_motion_has_a_picture() -> None:
    assert {file.stem for file in motions.PICTURES.iterdir()} == {motion.name for motion in motions.MOTIONS}


@pytest.mark.parametrize("motion", motions.MOTIONS, ids=lambda each: each.name)
def test_a_picture_moves_and_is_small(motion: motions.Motion) -> None:
    file = motions.PICTURES / f"{motion.name}.svg"
    assert file.stat().st_size < LARGEST
    text = file.read_text(encoding="utf-8")
    drawn = frames(text)
    assert all(len(path) == motions.FRAMES for path in drawn) and any(len(set(path)) > 10 for path in drawn)
    inside = np.array(re.findall(r"(-?\d+\.\d) (-?\d+\.\d)(?=[ML;\"])", text), dtype=float)
    frame = np.array(re.findall(r'viewBox="0 0 (\d+) (\d+)"', text)[0], dtype=float)
    assert (inside >= 0.0).all() and (inside <= frame).all()
    assert (np.ptp(inside, axis=0) > frame - 2 * motions.MARGIN - 2).all(), "the frame is larger than what moves in it"


def test_what_is_drawn_is_where_the_motion_is() -> None:
    """A rod that turns by a quarter within the picture's time: seen along its axis, from level to upright."""
    scene = (
        fm.SceneBuilder("rod", gravity=(0, 0, 0))
        .rigid_body("rod", mass=1.0, inertia=(0.1, 0.1, 0.1), nodes={"end": (1.0, 0.0, 0.0)})
        .revolute("pivot", "ground", "rod", axis=(0, -1, 0), rate=0.5 * np.pi)
        .marker("end", "rod", node="end")
        .scene()
    )
    seen = motions.Motion("rod", "", "A rod", 1.0, azimuth=0.0, elevation=0.0)
    trajectory = fm.simulate(scene, t_end=1.0, samples=motions.FRAMES, rtol=1e-9, atol=1e-11)
    line = Line(body="rod", kind="arm", points=(CarriedPoint("end", (-1.0, 0.0, 0.0)), CarriedPoint("end", (0.0,) * 3)))
    (arm,) = frames(motions.picture(trajectory, Drawing(lines=(line,), trails=()), seen))
    tips = [tuple(map(float, re.findall(r"[\d.]+", frame)[-2:])) for frame in arm]
    feet = [tuple(map(float, re.findall(r"[\d.]+", frame)[:2])) for frame in arm]
    (first, last), foot = (tips[0], tips[-1]), feet[0]
    assert len(set(feet)) == 1
    assert first[1] == foot[1] and first[0] > foot[0] + 100
    assert last[0] == foot[0] and foot[1] - last[1] == pytest.approx(first[0] - foot[0], abs=0.2)  # of 0.1 pixel


def test_the_first_picture_is_what_the_generator_draws_of_its_figures() -> None:
    kept = msgspec.json.decode(front.KEPT.read_bytes(), type=front.Front)
    assert front.PICTURE.read_text(encoding="utf-8") == front.picture(kept), "run `python -m tests.repo.front`"
    assert {"native", "pinocchio", "mujoco", "exudyn"} <= {curve.engine for curve in kept.curves}
    for page, address in front.PLACES.items():
        text = (ROOT / page).read_text(encoding="utf-8")
        assert f"]({address})" in text
        assert text == front.with_table(text, kept), "run `python -m tests.repo.front`"
        assert text != front.with_table(text, msgspec.structs.replace(kept, curves=kept.curves[1:]))
