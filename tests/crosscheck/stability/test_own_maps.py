"""Maps of a user's own file: drawn, recorded and judged as those of crosscheck, refused by name, shown in reports."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from crosscheck import cli
from crosscheck.report import write_all
from crosscheck.report.maps import Maps, read_maps
from crosscheck.stability.map_records import CellRecord, identity, read
from crosscheck.stability.picture import draw
from crosscheck.stability.run import maps_in, run_map
from crosscheck.stability.verdict_file import read_verdicts, write_verdicts
from flexmb.scene.user_code import no_user_code
from tests.crosscheck.report.sessions import MANY, session
from tests.crosscheck.sessions import here
from tests.crosscheck.stability.synthetic import PROVIDER

FILE = """
from dataclasses import replace

from tests.crosscheck.stability.synthetic import CIRCLE, shifted

MAPS = (replace(CIRCLE, name="mine", depth=2), replace(CIRCLE, name="wrong_one", overlay=shifted(0.3), depth=2))
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    file = tmp_path / "my_map.py"
    file.write_text(FILE, encoding="utf-8")
    return file


def run(*words: object) -> tuple[int, str]:
    done = CliRunner().invoke(cli.app, ["stability", *map(str, words)])
    return done.exit_code, " ".join(done.output.split())


def test_a_file_is_drawn_and_judged_and_can_fail(file: Path, tmp_path: Path) -> None:
    """In worker processes, which load the file again."""
    out = tmp_path / "out"
    code, text = run(file, "--jobs", 1, "--out", out)
    assert code == 1 and "1 of 2 maps agree" in text, text
    statuses = {each.map: each.status for each in read_verdicts(out / "maps.json")}
    assert statuses == {"mine": "agree", "wrong_one": "differ"}
    assert (out / "mine.svg").is_file()
    size = (out / "mine.jsonl").stat().st_size
    run(file, "--jobs", 1, "--out", out)
    cells = [each for each in read(out / "mine.jsonl") if isinstance(each, CellRecord)]
    assert len(cells) == len({each.cell for each in cells}) and (out / "mine.jsonl").stat().st_size > size


def test_an_edited_file_is_another_map(file: Path, tmp_path: Path) -> None:
    what = maps_in(file)["mine"]
    first = identity(what, file)
    assert identity(what, file) == first
    other = tmp_path / "other.py"
    other.write_text(FILE + "# edited\n", encoding="utf-8")
    assert identity(what, other) != first
    assert run_map("mine", tmp_path / "a.jsonl", provider=str(file), scheduler=here).verdict.ok


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("MAPS = ()", "it has no maps"), ("", "it has no maps"), ("MAPS = (1,)", "it has no maps"),
        ("1 / 0", "it cannot be loaded: ZeroDivisionError"),
        (FILE.replace('"mine"', '"../mine"'), '"../mine" is no identifier'),
        (FILE.replace("wrong_one", "mine"), "a name is used twice"),
        (FILE.replace("wrong_one", "free_spin"), 'two maps have the name "free_spin"'),
    ],
)  # fmt: skip
def test_what_is_no_file_of_maps_is_refused(file: Path, text: str, why: str) -> None:
    file.write_text(text, encoding="utf-8")
    code, said = run("free_spin", file, "--out", file.parent / "out")
    assert code == 2 and why in said, said
    code, said = run(file.with_name("none.py"), "--out", file.parent / "out")
    assert code == 2 and "there is no such Python file" in said


def test_code_of_others_can_be_forbidden(file: Path) -> None:
    with no_user_code():
        code, said = run(file, "--out", file.parent / "out")
    assert code == 2 and "user code was forbidden" in said


def test_reports_show_maps(tmp_path: Path) -> None:
    """With their pictures: as files of a report of pages, within a report of one file; nothing hostile is placed."""
    _, index = session(tmp_path, MANY)
    assert "Stability maps" not in index.read_text(encoding="utf-8")
    run_and_draw_circle(tmp_path)
    write_all(tmp_path / "records.jsonl", tmp_path)
    text = index.read_text(encoding="utf-8")
    assert "A circle" in text and 'src="assets/maps/circle.svg"' in text and "data:image" not in text
    shown, drawn = index.parent / "assets" / "maps" / "circle.svg", tmp_path / "circle.svg"
    assert shown.read_text("utf-8") == drawn.read_text("utf-8")
    write_all(tmp_path / "records.jsonl", tmp_path, single_file=True)
    single = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert 'src="data:image/svg+xml;base64,' in single
    (tmp_path / "circle.svg").unlink()
    write_all(tmp_path / "records.jsonl", tmp_path)
    assert "circle.svg, is not beside the records" in index.read_text(encoding="utf-8")
    verdicts = (tmp_path / "maps.json").read_text(encoding="utf-8")
    (tmp_path / "maps.json").write_text(verdicts.replace('"circle"', '"../circle"'), encoding="utf-8")
    assert "names of maps are identifiers" in read_maps(tmp_path).error
    (tmp_path / "maps.json").write_text("{", encoding="utf-8")
    write_all(tmp_path / "records.jsonl", tmp_path)
    assert "maps.json cannot be read" in index.read_text(encoding="utf-8")
    assert read_maps(tmp_path / "nowhere") == Maps()


def run_and_draw_circle(out: Path) -> None:
    done = run_map("circle", out / "circle.jsonl", provider=PROVIDER, depth=1, scheduler=here)
    draw(done, out / "circle.svg")
    write_verdicts([done.verdict], out / "maps.json")
