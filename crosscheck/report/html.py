"""report.html: one file that shows everything and needs neither network nor engine."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
from jinja2 import Environment, PackageLoader, select_autoescape
from markupsafe import Markup, escape
from plotly.offline import get_plotlyjs

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.results import CaseResults, Session
from crosscheck.judging.verdict import STATUSES
from crosscheck.report.charts import payload
from crosscheck.report.views import comparison_tables, conservation_table, control_table, overview
from flexmb.output.printable import printable


def write_report(session: Session, outcome: SessionOutcome, file: Path) -> None:
    """Write the report of a judged session."""
    templates = _templates()
    data = payload([(case, outcome.verdicts[case.case.case]) for case in session.cases])
    page = templates.get_template("report.html.j2").render(
        outcome=outcome,
        counts=outcome.counts(),
        statuses=STATUSES,
        controls=outcome.controls(),
        overview=overview(outcome.verdicts),
        cases=[_case_view(number, case, outcome) for number, case in enumerate(session.cases)],
        environment=session.environments[-1] if session.environments else None,
        engines=_engines(session),
        style=_inline(templates, "style.css"),
        scripts=[Markup(get_plotlyjs()), *(_inline(templates, name) for name in ("charts.js", "scene.js", "page.js"))],
        data=embedded(data),
    )
    file.write_text(page, encoding="utf-8", errors="backslashreplace")


@cache
def _templates() -> Environment:
    templates = Environment(
        loader=PackageLoader("crosscheck.report"),
        autoescape=select_autoescape(["html.j2"], default_for_string=True, default=True),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=False,
        finalize=_shown,
    )
    templates.filters["code"] = _code
    templates.filters["breakable"] = _breakable
    return templates


def embedded(data: Any) -> Markup:
    """Data as JSON that is safe in a script element: nothing in it looks like the end of the element or of a line."""
    text = msgspec.json.encode(data).decode()
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)


def _shown(value: Any) -> Any:
    """Text as a template prints it: plain text without control characters; markup is our own."""
    return printable(value) if type(value) is str else value


def _inline(templates: Environment, name: str) -> Markup:
    """A file of the templates folder as it is."""
    assert templates.loader is not None
    return Markup(templates.loader.get_source(templates, name)[0])


def _code(text: str) -> Markup:
    """Text of a README or a note with `words in backticks` set as code."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(printable(text)))))


def _breakable(text: str) -> Markup:
    """Text that may be broken after a slash."""
    return Markup(str(escape(printable(text))).replace("/", "/<wbr>"))


def _case_view(number: int, case: CaseResults, outcome: SessionOutcome) -> dict[str, Any]:
    record = case.case
    verdicts = outcome.verdicts[record.case]
    return {
        "number": number,
        "anchor": f"case-{number}",
        "name": record.case,
        "title": record.run.title,
        "summary": _first_paragraph(record.readme),
        "provenance": record.provenance,
        "variants": [_variant_view(case, variant) for variant in record.run.variants],
        "ok": all(verdict.ok for verdict in verdicts) and not any(a.case == record.case for a in outcome.lost),
        "tables": comparison_tables(verdicts),
        "conservation": conservation_table([verdict for verdict in verdicts if verdict.kind == "conservation"]),
        "controls": control_table([verdict for verdict in verdicts if verdict.kind == "control"]),
        "absences": [absence for absence in outcome.absences if absence.case == record.case],
        "timings": _timings(case),
    }


def _variant_view(case: CaseResults, variant: Any) -> dict[str, Any]:
    info = case.case.variants[variant.name]
    return {
        "name": variant.name,
        "level": info.level,
        "engines": ", ".join(variant.engines),
        "how": _transformation(variant),
        "duration": variant.duration_s or case.case.run.duration_s,
        "note": info.error or variant.note,
    }


def _transformation(variant: Any) -> str:
    return {
        "none": "",
        "rigidify": "flexible bodies made rigid",
        "modal_points": "beams as points and modes",
        "segments": f"{variant.segments} rigid segments per beam",
        "substructures": f"{variant.pieces} flexible pieces per beam",
    }[variant.transform]


def _timings(case: CaseResults) -> list[dict[str, Any]]:
    """Compile and solve time of each finest run."""
    return [
        {
            "engine": engine,
            "variant": variant,
            "effort": result.finest.effort,
            "compile_s": result.finest.compile_s,
            "wall_s": result.finest.wall_s,
            "evaluations": result.finest.evaluations,
            "support": result.finest.support,
        }
        for (variant, engine, role), result in case.results.items()
        if role == "main" and result.runs
    ]


def _engines(session: Session) -> list[tuple[str, str]]:
    """Engines with the versions that ran."""
    found: dict[str, set[str]] = {}
    for case in session.cases:
        for (_, engine, _), result in case.results.items():
            found.setdefault(engine, set()).update(run.version for run in result.runs)
    return [(engine, ", ".join(sorted(versions)) or "did not run") for engine, versions in sorted(found.items())]


def _first_paragraph(readme: str) -> str:
    """The README's first paragraph of plain text."""
    paragraphs = [part.strip() for part in readme.split("\n\n")]
    text = [part for part in paragraphs if part and not part.startswith(("#", "!", "|", "`", "-", "<"))]
    return " ".join(text[0].split()) if text else ""
