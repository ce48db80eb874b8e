"""The pages of measured sets, as far as they can be held without a browser; `test_browser.py` draws one."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
from typer.testing import CliRunner

from crosscheck.cli.common import app
from crosscheck.report.measured import RESULTS, write_measured
from crosscheck.report.site import LISTING
from crosscheck.validation.budget import budget, document
from crosscheck.validation.measured_set import read_set
from tests.crosscheck.report.test_site import Page
from tests.crosscheck.validation.test_budget import LINE, SLOPE, made


def test_every_address_leads_somewhere_whatever_a_set_is_called(tmp_path: Path) -> None:
    """A folder called index, and one whose name is markup."""
    names = ("index", "a b#c<i>&")
    for name in names:
        (tmp_path / name).mkdir()
    budgets = [budget(read_set(made(tmp_path / name))) for name in names]
    index = write_measured(budgets, "two sets", tmp_path / "out")
    pages = sorted(index.parent.glob("*.html"))
    assert len(pages) == 3
    for page in pages:
        for address in Page(page).addresses:
            file, _, part = address.partition("#")
            assert (page.parent / file).is_file() if file else part in Page(page).ids, address
    assert set(json.loads((index.parent / LISTING).read_text())) >= {page.name for page in pages}
    assert not any("<i>" in page.read_text(encoding="utf-8") for page in pages)


def test_the_page_and_the_json_have_the_budget(tmp_path: Path) -> None:
    """Both are of `document`, to the last digit; shares are those of the sum of squares."""
    known = budget(read_set(made(tmp_path, model=LINE + SLOPE)), samples=5)
    index = write_measured([known], "one set", tmp_path / "out")
    numbers = document(known)
    assert json.loads((tmp_path / "out" / RESULTS).read_text())[tmp_path.name] == numbers
    script = next(index.parent.glob("*.data.js")).read_text(encoding="utf-8")
    call = re.fullmatch(r'crosscheck\.register\("case-0", (.*)\);\s*', script)
    assert call is not None
    registered = json.loads(call[1])
    assert registered["points"] == numbers["points"] and registered["series_of"] == numbers["series"]
    np.testing.assert_allclose(registered["series_of"][0]["shares"], np.array([30.0 * 0.01, 0.09]) / 0.39, rtol=1e-9)
    page = next(file for file in index.parent.glob("*.html") if file != index).read_text(encoding="utf-8")
    assert page.count('class="verdict"') == 1 and "by the source" in page and ">exact<" in page
    assert "✕" not in page


def test_an_unexpected_series_is_seen(tmp_path: Path) -> None:
    """On its page, in the index, and by the exit code."""
    result = CliRunner().invoke(app, ["validate", str(made(tmp_path, off=3.0)), "--out", str(tmp_path / "out")])
    assert result.exit_code == 1 and "Report:" in result.output
    for page in (tmp_path / "out" / "report").glob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert '<header class="bad">' in text and "&#34;validated&#34; was expected" in text
