"""The report as a folder of pages, as far as it can be held without a browser."""

import re
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path

import msgspec
import pytest

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.verdict import Status
from crosscheck.mutation.campaign import MutationFile
from crosscheck.mutation.mutants import PassedOver
from crosscheck.mutation.score import Mutant, Outcome, ShownIn, mutation_score
from crosscheck.report import write_all
from crosscheck.report.html import places, source
from crosscheck.report.mutations import FILE, read_scores
from crosscheck.report.site import LISTING, SINGLE
from crosscheck.report.views import comparison_blocks
from tests.crosscheck.report.sessions import MANY, session

TEXTS = ("ink", "soft", "good", "bad", "expected")
GROUNDS = {"ink": ("page", "wash", "expectedwash"), "soft": ("page", "wash"), "good": ("page", "wash", "goodwash"),
           "bad": ("page", "wash", "badwash"), "expected": ("page", "wash", "expectedwash")}  # fmt: skip
FOCUSABLE = {"a", "button", "input", "select", "summary"}


class Page(HTMLParser):
    """Ids, addresses, verdicts, and what the key Tab reaches before anything is opened."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.addresses: list[str] = []
        self.verdicts = self.stops = 0
        self._closed: list[bool] = []  # of the details that one is in
        self._heading = False
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        given = dict(attributes)
        self.ids += [given["id"]] if given.get("id") else []
        self.addresses += [given[key] for key in ("href", "src") if given.get(key)]
        self.verdicts += given.get("class") == "verdict"
        hidden = any(self._closed[:-1] if tag == "summary" else self._closed)
        self.stops += not hidden and (tag in FOCUSABLE or given.get("tabindex") == "0")
        if tag == "details":
            self._closed.append("open" not in given)

    def handle_endtag(self, tag: str) -> None:
        if tag == "details":
            self._closed.pop()


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[SessionOutcome, Path]:
    return session(tmp_path_factory.mktemp("site"), MANY)


def test_every_address_leads_somewhere(written: tuple[SessionOutcome, Path]) -> None:
    site = written[1].parent
    files = list(site.rglob("*.html"))
    assert {str(file.relative_to(site)) for file in files} == {"index.html", "pendulum/single.html"}
    for file in files:
        for address in Page(file).addresses:
            path, _, part = address.partition("#")
            target = (file.parent / path).resolve() if path else file
            assert target.is_file(), f"{file.name}: {address}"
            assert not part or part in Page(target).ids, f"{file.name}: {address}"


def test_the_old_address_leads_to_the_index(written: tuple[SessionOutcome, Path]) -> None:
    leading = written[1].parents[1] / SINGLE
    assert 'content="0; url=report/index.html"' in leading.read_text(encoding="utf-8")


def test_every_verdict_stands_on_its_page_once(written: tuple[SessionOutcome, Path]) -> None:
    page = Page(written[1].parent / "pendulum" / "single.html")
    assert page.verdicts == len(written[0].all) > 100
    assert max(Counter(page.ids).values()) == 1


def test_what_is_not_as_expected_comes_first_with_a_way_to_it(written: tuple[SessionOutcome, Path]) -> None:
    index, page = Page(written[1]), Page(written[1].parent / "pendulum" / "single.html")
    ways = [address.partition("#")[2] for address in index.addresses if "-verdict-" in address]
    assert len(ways) == len(written[0].unexpected) > 0
    assert set(ways) <= set(page.ids)
    text = written[1].read_text(encoding="utf-8")
    assert text.index("Not as expected</h2>") < text.index("Cases and engines</h2>")


def test_few_stops_of_the_tabulator(written: tuple[SessionOutcome, Path]) -> None:
    """A hundred verdicts are folded into their comparisons."""
    assert Page(written[1].parent / "pendulum" / "single.html").stops < 45
    assert Page(written[1]).stops < 30 + len(written[0].unexpected)


def test_a_block_says_its_worst(written: tuple[SessionOutcome, Path]) -> None:
    verdicts = written[0].verdicts["pendulum/single"]
    for block in comparison_blocks(written[0], verdicts):
        inside = [verdict for verdict in verdicts if verdict.kind == "comparison" and verdict.comparison == block.title]
        assert len(block.lines) == len(inside)
        assert block.open == any(not each.ok for each in inside)
        judged = [each.E / each.goal for each in inside if each.E is not None]
        worst = re.search(r"E ([\d.e+-]+),.* goal ([\d.e+-]+)", block.figures)
        assert bool(judged) == bool(worst)
        if worst:
            assert float(worst[1]) / float(worst[2]) == pytest.approx(max(judged), rel=0.2)


def test_pages_of_an_earlier_report_are_cleared_away_and_nothing_else(tmp_path: Path) -> None:
    _, index = session(tmp_path, MANY)
    site = index.parent
    mine = site / "mine.txt"
    mine.write_text("kept", encoding="utf-8")
    listed = msgspec.json.decode((site / LISTING).read_bytes())
    (site / "old").mkdir()
    (site / "old" / "case.html").write_text("stale", encoding="utf-8")
    outside = tmp_path / "precious"
    outside.write_text("kept", encoding="utf-8")
    (site / LISTING).write_bytes(msgspec.json.encode([*listed, "old/case.html", "../precious"]))
    write_all(tmp_path / "records.jsonl", tmp_path)
    assert not (site / "old" / "case.html").exists()
    assert mine.read_text(encoding="utf-8") == outside.read_text(encoding="utf-8") == "kept"
    write_all(tmp_path / "records.jsonl", tmp_path, single_file=True)
    assert not index.exists() and "Not as expected" in (tmp_path / SINGLE).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["../../x", "index", "a/index", "a b/c", "a?b/c", "</x>", "..", "a/b/c", "ä/ö"])
def test_a_page_has_an_address_that_every_browser_takes(name: str) -> None:
    names = [name, name.replace(" ", "?"), f"{name}!", "index"]
    found = places(dict.fromkeys(names), single=False)
    pages = [place.page for place in found.values()]
    assert len(set(pages)) == len(found)
    assert all(re.fullmatch(r"[\w-]+(/[\w-]+)?\.html", page, re.ASCII) and page != "index.html" for page in pages)


def test_mutation_scores_are_shown(tmp_path: Path) -> None:
    _, index = session(tmp_path, MANY)
    sign = mutant("gravity_sign", "noticed", **{"marker:tip.position": "differ", "load": "agree"})
    mass = mutant("mass", "missed")
    idle = PassedOver(mutation="wheel", target="", reason="there is no wheel")
    single = mutation_score("pendulum/single", "rigid", "fine", [sign, mass], [idle])
    scored = [single, mutation_score("none", "rigid", "fine", [], [])]
    (tmp_path / FILE).write_bytes(msgspec.json.encode(MutationFile(cases=tuple(scored))))
    write_all(tmp_path / "records.jsonl", tmp_path)
    text, page = index.read_text(encoding="utf-8"), (index.parent / "pendulum" / "single.html").read_text("utf-8")
    tags = re.compile("<[^>]*>")
    assert "0.50" in text and "mass of arm" in text and "none applies" in text
    assert "Mutation score 0.50 · by the stored reference 1.00" in tags.sub("", page)
    assert "too small to be seen" in page and "does not apply" in page
    assert "missed by load" in page
    (tmp_path / FILE).write_text("{", encoding="utf-8")
    write_all(tmp_path / "records.jsonl", tmp_path)
    assert "mutation.json cannot be read" in index.read_text(encoding="utf-8")
    (tmp_path / FILE).write_bytes(b'{"cases": [], "\xc0": 1}')  # in a part that nothing reads
    assert "not UTF-8" in read_scores(tmp_path).error
    assert read_scores(tmp_path / "nowhere").cases == {}


def mutant(name: str, outcome: Outcome, **channels: Status) -> Mutant:
    return Mutant(
        mutation=name, target="arm", of="scene", outcome=outcome, beyond_goal=False, reason="too small to be seen",
        channels={key: ShownIn(status=status, E=0.0, U=1e-9, goal=1e-6) for key, status in channels.items()},
        by_reference="noticed" if outcome == "noticed" else None,
    )  # fmt: skip


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_colours_stand_out(scheme: str) -> None:
    colours = schemes()[scheme]
    for text in TEXTS:
        for ground in GROUNDS[text]:
            assert contrast(colours[text], colours[ground]) >= 4.5, (text, ground)
    for mark in ("edge", "focus", "good", "bad", "expected"):
        assert contrast(colours[mark], colours["page"]) >= 3.0, mark


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("script", ["charts.js", "scene.js"])
def test_curves_and_bodies_stand_out(script: str, scheme: str) -> None:
    text = str(source(script))
    pairs = re.findall(r'\["(#[0-9a-f]{6})", "(#[0-9a-f]{6})"\]', text)  # one for each scheme
    of_both = set(re.findall(r"#[0-9a-f]{6}", text)) - {colour for pair in pairs for colour in pair}
    drawn = of_both | {pair[["light", "dark"].index(scheme)] for pair in pairs}
    assert len(drawn) > 10
    for colour in drawn:
        assert contrast(colour, schemes()[scheme]["page"]) >= 3.0, colour


def schemes() -> dict[str, dict[str, str]]:
    """The variables of the style sheet by scheme."""
    roots = re.findall(r":root \{(.*?)\}", str(source("style.css")), re.DOTALL)
    light, dark = (dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", rules)) for rules in roots)
    assert light.keys() == dark.keys()
    return {"light": light, "dark": dark}


def contrast(one: str, other: str) -> float:
    """Contrast of two colours, from 1 to 21, as WCAG 2 defines it."""
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def luminance(colour: str) -> float:
    parts = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    linear = [part / 12.92 if part <= 0.03928 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
