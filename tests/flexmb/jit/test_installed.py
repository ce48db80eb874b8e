"""Kernels that came with the installation: taken where they fit, never where they do not, and never written to."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from flexmb.jit import cache, hooks, installed, processors
from flexmb.jit.folder import warn_once
from flexmb.jit.installed import MADE_BY, description, unfit
from flexmb.jit.kernel import kernel
from tests.flexmb.jit.test_cache import DAMAGES, kernels, weighted
from tests.repo.project import ROOT

LEVEL = "x86-64-v3"
PROBE = """
from tests.flexmb.jit.test_cache import weighted
from flexmb.jit.kernel import kernel
import numpy as np
fresh = kernel(weighted)
assert fresh(np.array([0.5, 0.25]), 2.0) == 1.5
print(sum(fresh.stats.cache_hits.values()))
"""


@pytest.fixture
def folders(tmp_path, monkeypatch):
    """(the user's folder, that of the installation)."""
    own, came = tmp_path / "own", tmp_path / "came"
    monkeypatch.setattr(hooks, "cache_directory", lambda: own)
    monkeypatch.setattr(cache, "installed_directory", lambda: came)
    warn_once.cache_clear()
    return own, came


def hits() -> int:
    """Versions that were found: of two."""
    fresh = kernel(weighted)
    assert fresh(np.arange(4), 2.0) == 12.0
    assert fresh(np.array([0.5, 0.25]), 2.0) == 1.5
    return sum(fresh.stats.cache_hits.values())


def install(own: Path, came: Path) -> list[Path]:
    """What was compiled so far is what came with the installation, and the user has nothing."""
    shutil.move(own, came)
    return kernels(came)


def test_they_are_found_and_nothing_is_written(folders):
    assert hits() == 0
    install(*folders)
    assert hits() == 2
    assert not folders[0].exists()


def test_they_are_found_where_nothing_can_be_written(folders, monkeypatch):
    assert hits() == 0
    install(*folders)
    monkeypatch.setattr(hooks, "cache_directory", lambda: None)
    assert hits() == 2


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_ones_are_left_where_they_are_and_compiled_anew_with_one_warning(damage, folders):
    assert hits() == 0
    files = install(*folders)
    for file in files:
        damage(file)
    before = [file.stat().st_mtime_ns for file in files]
    with pytest.warns(RuntimeWarning, match="install flexmb again") as warned:
        assert hits() == 0
    assert len(warned) == 1
    assert [file.stat().st_mtime_ns for file in files] == before
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert hits() == 2  # the user's own now


def test_what_the_user_compiled_comes_first(folders):
    own, came = folders
    assert hits() == 0
    shutil.copytree(own, came)
    for file in kernels(came):
        file.write_bytes(b"never looked at")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert hits() == 2


def in_a_process(folder: Path, **environment: str) -> int:
    given = os.environ | {"NUMBA_CACHE_DIR": str(folder), "PYTHONPATH": str(ROOT)} | environment
    done = subprocess.run([sys.executable, "-c", PROBE], env=given, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return int(done.stdout)


@pytest.mark.skipif(LEVEL not in processors._levels(), reason="this processor is none of that level")
def test_those_for_a_level_run_on_every_processor_that_has_it(folders, tmp_path):
    _, came = folders
    of_level = {"NUMBA_CPU_NAME": LEVEL, "NUMBA_CPU_FEATURES": ""}
    assert in_a_process(tmp_path / "built", **of_level) == 0
    shutil.move(tmp_path / "built" / "flexmb-kernels", came)
    fresh = kernel(weighted)
    assert fresh(np.array([0.5, 0.25]), 2.0) == 1.5
    assert sum(fresh.stats.cache_hits.values()) == 1


def test_who_names_a_processor_gets_kernels_for_that_one_only(tmp_path):
    assert in_a_process(tmp_path) == 0
    assert in_a_process(tmp_path) == 1
    assert in_a_process(tmp_path, NUMBA_CPU_NAME="x86-64", NUMBA_CPU_FEATURES="") == 0


REASONS = {
    "numba": (lambda made: made["versions"].update(numba="0.1"), "for numba 0.1, and this is"),
    "Python": (lambda made: made["versions"].update(Python="2.7"), "for Python 2.7, and this is"),
    "processor": (lambda made: made.update(processor=["arm", "m1", ""]), "for another processor"),
    "compiler": (lambda made: made.update(compiler="00"), "flexmb/jit has changed"),
    "nothing": (lambda made: made["versions"].clear(), "for Python (unknown)"),
}


@pytest.fixture
def manifest(tmp_path, monkeypatch):
    """What describes the kernels that came, of this very process."""
    (tmp_path / MADE_BY).write_text(json.dumps(description()))
    monkeypatch.setattr(installed, "installed_directory", lambda: tmp_path)
    unfit.cache_clear()
    yield tmp_path / MADE_BY
    unfit.cache_clear()


@pytest.mark.parametrize("change", REASONS)
def test_why_they_do_not_fit_is_said(change, manifest):
    alter, words = REASONS[change]
    made = json.loads(manifest.read_text())
    alter(made)
    manifest.write_text(json.dumps(made))
    assert words in unfit()


@pytest.mark.parametrize("text", ["", "[]", "null", "{", "{}", '{"versions": []}', "\x00"])
def test_a_damaged_description_is_none(text, manifest):
    manifest.write_text(text)
    assert unfit() == "no kernels came with the installation"


def test_they_fit_the_process_that_made_them(manifest):
    assert unfit() == ""
