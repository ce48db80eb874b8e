"""The documentation site builds without a warning, and every page is in it; generated pages are up to date."""

import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from tests.repo import catalogue, examples, gallery, margins, motions, threads
from tests.repo.project import ROOT
from tests.repo.snippets import PAGES

WRITTEN = [catalogue, examples, gallery, margins, motions, threads]


@pytest.mark.parametrize("maker", WRITTEN, ids=lambda maker: maker.PAGE.name)
def test_a_page_is_what_its_generator_writes(maker: ModuleType) -> None:
    assert maker.PAGE.read_text(encoding="utf-8") == maker.page(), f"run `python -m {maker.__name__}`"


def test_pages_of_cases_are_what_their_generator_writes() -> None:
    written = {path: path.read_text(encoding="utf-8") for path in catalogue.FOLDER.glob("*.md")}
    assert written == catalogue.pages(), f"run `python -m {catalogue.__name__}`; delete what is left over"


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
