"""A case whose scene is doubtful runs with a warning; with `--strict` it does not run, and says why."""

from __future__ import annotations

from pathlib import Path

import pytest

from crosscheck.cli.common import sole_writer
from crosscheck.library.find import Case, load_case
from crosscheck.running.plan import plan
from flexmb.scene.problems import SceneWarning
from tests.crosscheck.sessions import PROVIDER, copy_case


@pytest.fixture
def doubtful(tmp_path: Path) -> Case:
    """The small case with a damper that drives."""
    folder = copy_case(tmp_path)
    scene = folder / "scene.toml"
    text = scene.read_text(encoding="utf-8")
    assert text.count('type = "revolute"') + text.count('kind = "revolute"') == 1
    line = next(line for line in text.splitlines() if '"revolute"' in line)
    scene.write_text(text.replace(line, f"{line}\nrotation = {{ damping_Nms_rad = -0.01 }}"), encoding="utf-8")
    return load_case(folder)


def test_it_is_planned_with_a_warning(doubtful: Case) -> None:
    with pytest.warns(SceneWarning, match="negative damping"):
        _, jobs = plan(doubtful, (), PROVIDER)
    assert jobs and all(not job.error for job in jobs)


@pytest.mark.filterwarnings("default")  # what a command warns of is printed, no error
def test_strictly_its_runs_are_errors(doubtful: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with sole_writer(tmp_path / "strict", strict=True):
        _, jobs = plan(doubtful, (), PROVIDER)
    main = [job for job in jobs if job.role == "main"]
    assert main and all("negative damping" in job.error and job.scene is None for job in main)
    with sole_writer(tmp_path / "lenient"):
        plan(doubtful, (), PROVIDER)
        plan(doubtful, (), PROVIDER, films=True)
    assert capsys.readouterr().err.count("warning: ") == 1
