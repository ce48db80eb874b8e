"""Names that look like markup, through every printer, read back with a parser of each format."""

import csv
import io
import json
import re
import tempfile
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import msgspec
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from markdown_it import MarkdownIt
from rich.console import Console

from crosscheck.judging.outcome import Absence, SessionOutcome, conclude
from crosscheck.judging.results import collect
from crosscheck.judging.verdict import Verdict
from crosscheck.library.case import Comparison, ComparisonSide
from crosscheck.library.find import load_case
from crosscheck.records.archive import Archive, read
from crosscheck.records.kinds import BrokenLine, RunRecord
from crosscheck.records.machine import environment
from crosscheck.report import write_all
from crosscheck.report.ci import write_summary
from crosscheck.report.html import embedded
from crosscheck.report.junit import write_junit
from crosscheck.running.installed import EngineState
from crosscheck.running.plan import plan
from crosscheck.running.scheduler import Event
from crosscheck.terminal.listings import cases_table, engines_table
from crosscheck.terminal.progress import LiveProgress
from crosscheck.terminal.verdicts import print_outcome
from flexmb.output.files import as_text, from_text
from flexmb.output.printable import chart_text, printable
from tests.crosscheck.sessions import CASE, PROVIDER

NASTY = (
    "[red]a[/]", "[/]", "[link=http://x]a[/link]", ":warning:", "a|b", "`a`", "``", "*a* _a_ **a**", "<b>a</b>", "\\",
    "</script><script>alert(1)</script>", "<!--", "]]>", "&amp;", "%{x}", "$x$", "$\\bad{", "_a", "a,b;\"c\"", "\\[a]",
    "\x1b[31ma", "\x00", "\x85", "\u2028", "\u202eabc", "\ufffe", "a\nb", "# a", "- a", "1. a", "~~a~~", "[a](b)",
    "../../x", "![a](b)",
)  # fmt: skip
FOREIGN = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=20) | st.sampled_from(NASTY)


def outcome_of(name: str) -> SessionOutcome:
    verdict = Verdict(
        case=name, comparison=name, kind="comparison", channel=f"marker:{name}.position", variant_a=name, engine_a=name,
        variant_b=name, engine_b=name, level="", status="differ", expected="agree", E=1.0, U=0.1, goal=0.1, scale=1.0,
        reason=name,
    )  # fmt: skip
    return SessionOutcome({name: [verdict]}, [Absence(name, name, name, "main", "did not run", name)], (name,))


def flat(text: str) -> str:
    return printable(" ".join(text.split()))


def shown(*renderables: object) -> str:
    console = Console(file=io.StringIO(), width=10_000, force_terminal=False)
    for renderable in renderables:
        console.print(renderable)
    return console.file.getvalue()


@given(FOREIGN)
def test_the_terminal_shows_what_stands_there(name: str) -> None:
    console = Console(file=io.StringIO(), width=10_000, force_terminal=False)
    print_outcome(console, outcome_of(name))
    output = console.file.getvalue()
    want = printable(name)
    for line in want.split("\n"):
        assert line.strip() in output
    assert not re.search("[\x00-\x08\x0e-\x1f\x7f-\x9f\u202a-\u202e]", output)
    table = shown(engines_table([EngineState(name, name, name, name)]))
    assert want.split("\n")[0].strip() in table


@given(FOREIGN)
def test_markdown_shows_what_stands_there(name: str) -> None:
    assume(flat(name))
    text = written(write_summary, name)
    parser = MarkdownIt("commonmark").enable(["table", "strikethrough"])
    tokens = parser.parse(text)
    cells = ["".join(part.content for part in token.children or ()) for token in tokens if token.type == "inline"]
    tables = [i for i, token in enumerate(tokens) if token.type == "tr_open"]
    assert len(tables) == 4  # two tables of a heading and one row
    row = cells[cells.index("reason") + 1 :][:7]
    assert row[:2] == [flat(name)] * 2
    assert row[2] == flat(f"marker:{name}.position") or row[2] == f" {flat(f'marker:{name}.position')} "
    assert row[6] == flat(name)
    assert cells[-1] == flat(name)
    assert {"html_block", "html_inline", "link_open", "image"}.isdisjoint(
        part.type for token in tokens for part in (token, *(token.children or ()))
    )


@given(FOREIGN)
def test_junit_is_xml_that_says_what_stands_there(name: str) -> None:
    suites = ElementTree.fromstring(written(write_junit, name))
    failures = [each.get("message") for each in suites.iter("failure")]
    assert failures == [f"differ, expected agree: {printable(name)}", printable(name), printable(name)]
    assert suites[0].get("name") == printable(name)


@given(st.recursive(FOREIGN, lambda inner: st.lists(inner) | st.dictionaries(FOREIGN, inner)))
def test_embedded_data_comes_back(data: object) -> None:
    text = str(embedded(data))
    assert json.loads(text) == data
    assert not re.search("[<>&\u2028\u2029]", text)


@pytest.mark.parametrize("name", NASTY)
def test_matplotlib_takes_any_name(name: str) -> None:
    from matplotlib.figure import Figure

    figure = Figure()
    axes = figure.add_subplot()
    axes.plot([0, 1], label=chart_text(name))
    figure.suptitle(chart_text(name))
    assert len(axes.legend().get_texts()) == 1
    figure.savefig(io.BytesIO(), format="svg")


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Records of a case whose every name and text is hostile, run by engines with such names."""
    folder = tmp_path_factory.mktemp("hostile")
    case, evil = load_case(CASE), "</script><script>alert('[/]|`')</script><!-- ]]>\x1b[31m\x00\u2028%{x}"
    record, _ = plan(case, (), PROVIDER)
    one, other = ComparisonSide(variant=evil, engine=evil), ComparisonSide(variant=evil, engine=evil + "2")
    run = msgspec.structs.replace(
        record.run, title=evil,
        variants=(msgspec.structs.replace(record.run.variants[0], name=evil, engines=(evil, evil + "2"), note=evil),),
        comparisons=(Comparison(name=evil, a=one, b=other, goals={"marker:tip": 1e-6}),), controls=(), conservations=(),
        charts=(msgspec.structs.replace(record.run.charts[0], title=evil, variants=(evil,), reference=evil),),
    )  # fmt: skip
    record = msgspec.structs.replace(
        record, case=evil, run=run, readme=evil,
        variants={evil: msgspec.structs.replace(record.variants["rigid"], error=evil)},
    )  # fmt: skip
    archive = Archive(folder / "records.jsonl")
    for each in (environment(), record):
        archive.write(each)
    for engine in run.variants[0].engines:
        blank = RunRecord(case=evil, variant=evil, role="main", engine=engine, version=evil, scene="s", status="failed")
        archive.write(msgspec.structs.replace(blank, message=evil))
    archive.close()
    return folder


class Scripts(HTMLParser):
    """Texts of the script elements, and everything else."""

    def __init__(self) -> None:
        super().__init__()
        self.scripts, self.inside, self.text, self.comments = [], False, "", 0

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.inside = tag == "script"
        if self.inside:
            self.scripts.append("")

    def handle_endtag(self, tag: str) -> None:
        self.inside = self.inside and tag != "script"

    def handle_comment(self, data: str) -> None:
        self.comments += 1

    def handle_data(self, data: str) -> None:
        if self.inside:
            self.scripts[-1] += data
        else:
            self.text += data


def test_the_report_holds_hostile_names_as_text(hostile: Path) -> None:
    outcome, page = write_all(hostile / "records.jsonl", hostile / "out", single_file=True)
    assert not outcome.ok
    text = page.read_text(encoding="utf-8")
    parsed = Scripts()
    parsed.feed(text)
    clean = write_all(_plain(hostile), hostile / "plain", single_file=True)[1].read_text(encoding="utf-8")
    usual = Scripts()
    usual.feed(clean)
    assert len(parsed.scripts) == len(usual.scripts)
    assert parsed.comments == usual.comments
    data = json.loads(re.fullmatch(r'crosscheck\.register\("case-0", (.*)\);\s*', parsed.scripts[-1]).group(1))
    assert data["panels"] == [] and "drifts" in data
    assert "alert('[/]|`')" in parsed.text
    assert "\x1b" not in text and "\x00" not in text


def _plain(hostile: Path) -> Path:
    """The same records with a harmless name."""
    file = hostile / "plain.jsonl"
    evil = json.dumps(read(hostile / "records.jsonl")[1].case, ensure_ascii=False)[1:-1]
    lines = (hostile / "records.jsonl").read_text(encoding="utf-8").split("\n")
    texts = [json.dumps(json.loads(line), ensure_ascii=False).replace(evil, "plain") for line in lines if line]
    file.write_text("\n".join(texts) + "\n", encoding="utf-8")
    return file


def test_the_other_printers_take_hostile_names(hostile: Path) -> None:
    records = read(hostile / "records.jsonl")
    assert [record for record in records if isinstance(record, BrokenLine)] == []
    session = collect(records)
    case = session.cases[0].case
    console = Console(file=io.StringIO(), width=400)
    print_outcome(console, conclude(session))
    console.print(cases_table([msgspec_case(case)]))
    job = type("Job", (), {"title": case.case, "engine": case.case, "expected_s": None})()
    with LiveProgress(console) as live:
        live.hear([job], Event(0, "started"))
        live.hear([job], Event(0, "emitted", case.case))
        live.hear([job], Event(0, "emitted", records[2]))
        live.hear([job], Event(0, "ended"))
    output = console.file.getvalue()
    assert output.count("<script>alert('[/]|`')") > 4
    assert "\x1b[31m" not in output


def msgspec_case(record: object) -> object:
    return type("Case", (), {"name": record.case, "run": record.run, "accepted": {}})()


def written(write: object, name: str) -> str:
    """What a writer of an outcome writes."""
    with tempfile.TemporaryDirectory() as folder:
        write(outcome_of(name), Path(folder) / "file")
        return (Path(folder) / "file").read_text(encoding="utf-8")


def test_csv_headers_come_back(tmp_path: Path) -> None:
    from flexmb.run.run_arrays import MarkerPath, Statistics
    from flexmb.run.trajectory import Trajectory
    from flexmb.tables.status import Status

    t, three, six = np.zeros(2), np.zeros((2, 3)), np.zeros((2, 6))
    markers = {name: MarkerPath(three, np.zeros((2, 4)), six, six) for name in NASTY}
    run = Trajectory(
        "s", Status.OK, "", 0.0, t, six[:, :0], six[:, :0], (), (), markers, {}, {}, {}, {"kinetic": t}, six, t,
        Statistics(0, 0, 0, 0, 0, 0.0, 0.0, 0.0),
    )  # fmt: skip
    run.to_csv(tmp_path / "t.csv")
    with (tmp_path / "t.csv").open(newline="", encoding="utf-8") as stream:
        header, *rows = csv.reader(stream)
    assert header == [as_text(f"{name} [{unit}]") for name, unit, _ in run.columns()]
    assert [from_text(name) for name in header] == [f"{name} [{unit}]" for name, unit, _ in run.columns()]
    assert [len(row) for row in rows] == [len(header)] * 2
