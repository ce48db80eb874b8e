"""The repository as its own tests see it: where it is, what belongs to it, what its metadata says."""

import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
SOURCES = ("flexmb", "crosscheck", "cases", "examples", "tests", "docs", "paper", ".ci")
TEXT = {".py", ".toml", ".md", ".cff", ".json", ".html", ".css", ".js", ".csv", ".txt", ""}


def text_files() -> Iterator[Path]:
    """Every text file of the project, generated and cached ones left out."""
    yield from (path for path in sorted(ROOT.iterdir()) if path.is_file() and path.suffix in TEXT - {""})
    for folder in SOURCES:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.is_file() and path.suffix in TEXT and not is_cache(path.relative_to(ROOT / folder)):
                yield path


def spliced(page: str, start: str, table: str, end: str = "<!-- end -->") -> str:
    """A page with another table between these marks."""
    before, mark, rest = page.partition(start)
    _, closed, after = rest.partition(end)
    if not mark or not closed:
        raise ValueError(f"the page has no place for the table, between {start!r} and {end!r}")
    return before + mark + table + closed + after


def is_cache(path: Path) -> bool:
    """Whether a relative path lies in a folder that tools leave behind, or in that of the compiled kernels."""
    return any(part in ("__pycache__", "kernels") or part.startswith(".") for part in path.parts)
