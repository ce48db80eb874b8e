"""paper/paper.md has the form that the Journal of Open Source Software asks for, and cites what paper/paper.bib has."""

import re

import yaml

from tests.repo.project import ROOT

HEAD, _, TEXT = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8").removeprefix("---\n").partition("\n---\n")
BIBLIOGRAPHY = (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8")
SECTIONS = [
    "Summary", "Statement of need", "State of the field", "Software design", "Research impact statement",
    "AI usage disclosure", "Acknowledgements", "References",
]  # fmt: skip
ENTRY = re.compile(r"^@(\w+)\{(\w+),\n(.*?)^\}", re.M | re.S)


def test_the_head_has_what_the_journal_reads() -> None:
    head = yaml.safe_load(HEAD)
    assert {"title", "tags", "authors", "affiliations", "date", "bibliography"} <= set(head)
    assert (ROOT / "paper" / head["bibliography"]).is_file()
    places = {affiliation["index"] for affiliation in head["affiliations"]}
    assert {author["affiliation"] for author in head["authors"]} <= places
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert [author["name"] for author in head["authors"]] == [author["name"] for author in citation["authors"]]


def test_sections_and_length() -> None:
    """The sections that are required since 2026, in their order, and between 750 and 1750 words."""
    assert re.findall(r"^# (.+)$", TEXT, re.M) == SECTIONS
    assert 750 <= len(TEXT.split()) <= 1750


def test_what_is_cited_is_in_the_bibliography_and_nothing_else() -> None:
    entries = {key: fields for _, key, fields in ENTRY.findall(BIBLIOGRAPHY)}
    assert set(re.findall(r"@(\w+)", TEXT)) == set(entries)
    for key, fields in entries.items():
        known = dict(re.findall(r"^  (\w+) = \{(.*)\},?$", fields, re.M))
        assert {"title", "author", "year"} <= set(known) and key.endswith(known["year"]), key
        assert re.fullmatch(r"10\.\d{4,}/\S+", known.get("doi", "10.0000/none")), key
    found = re.findall(r"^  doi = \{(.*)\}", BIBLIOGRAPHY, re.M)
    assert len(set(found)) == len(found) >= len(entries) - 2  # a report and a site have none
