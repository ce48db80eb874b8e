"""docs/interchange.md: its snippets run, one after the other, as a reader would run them."""

from __future__ import annotations

import re
import shlex
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from flexmb.cli import app
from flexmb.interchange.sid import read_sid, write_sid

PAGE = Path(__file__).parents[3] / "docs" / "interchange.md"


def test_every_snippet_of_the_page_runs(tmp_path, monkeypatch):
    for library in ("pandas", "pyarrow", "xarray"):
        pytest.importorskip(library)
    viewer = find_spec("rerun") is not None  # 170 MB: not everybody who tests has it
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for language, code in re.findall(r"```(python|sh)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL):
        if not viewer:
            code = code.replace(" --also rrd", "").replace("trajectory.to_rerun", "# trajectory.to_rerun")
        if language == "python":
            exec(compile(code, str(PAGE), "exec"), names)
            continue
        for line in code.strip().splitlines():
            result = CliRunner().invoke(app, shlex.split(line)[1:])
            assert result.exit_code == 0, f"{line}\n{result.output}"
    before, after = (names[each].accelerations(names[each].initial_state) for each in ("before", "after"))
    assert np.allclose(before, after, rtol=1e-9, atol=1e-9 * np.max(np.abs(before)))
    for name in (
        "strip.sid",
        "again.sid",
        "strip.toml",
        "panel.sid",
        "panel.toml",
        "pendulum.toml",
        "run/trajectory.npz",
    ):
        assert (tmp_path / name).stat().st_size > 500, name
    assert (tmp_path / "swing.rrd").exists() == viewer
    (tmp_path / "back").mkdir()  # from the other dialect, under the same name
    write_sid(read_sid(tmp_path / "again.sid"), tmp_path / "back" / "strip.sid")
    given, back = ((tmp_path / each).read_text().replace("'", "") for each in ("strip.sid", "back/strip.sid"))
    assert given == back
