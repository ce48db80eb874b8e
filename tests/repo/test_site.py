"""The documentation site builds without a warning, and every page is in it; generated pages are up to date."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.repo import catalogue, threads
from tests.repo.project import ROOT
from tests.repo.snippets import PAGES


def test_the_catalogue_is_what_the_generator_writes() -> None:
    assert catalogue.PAGE.read_text(encoding="utf-8") == catalogue.page(), "run `python -m tests.repo.catalogue`"


def test_the_page_of_what_threads_may_share_is_what_the_generator_writes() -> None:
    assert threads.PAGE.read_text(encoding="utf-8") == threads.page(), "run `python -m tests.repo.threads`"


def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    pytest.importorskip("sphinx")
    build = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-E", "-d", tmp_path / "trees"]
    done = subprocess.run([*build, ROOT / "docs", tmp_path / "site"], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    built = {path.relative_to(tmp_path / "site").with_suffix("") for path in (tmp_path / "site").rglob("*.html")}
    assert {page.relative_to(ROOT / "docs").with_suffix("") for page in PAGES} <= built
    runs = (tmp_path / "site" / "api" / "runs.html").read_text(encoding="utf-8")
    assert re.search(r'id="flexmb\.simulate"', runs)
    assert "projected back to where all closures are closed" in " ".join(runs.split())
