"""docs/architecture.md against the tree and the import contracts, and its picture, which is drawn from them by

    python -m tests.repo.architecture
"""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

from tests.repo.project import PYPROJECT, ROOT

PAGE = ROOT / "docs" / "architecture.md"
PICTURE = ROOT / "docs" / "pictures" / "rooms.svg"
PACKAGES = ("crosscheck", "flexmb")
RECIPES = ("a hinge", "a level", "an integrator", "an algorithm", "an engine", "a case", "a map", "a channel")
SHARED = 3  # a letter that kernels of so many rooms take needs a line in the glossary

Layers = list[tuple[str, ...]]


# ---- The tree and the contracts


def rooms(package: str, root: Path = ROOT) -> set[str]:
    """Folders and modules of a package."""
    found = (path for path in (root / package).iterdir() if path.suffix == ".py" or (path / "__init__.py").exists())
    return {path.stem for path in found} - {"__init__"}


def layers(package: str, contracts: list[dict[str, Any]] | None = None) -> Layers:
    """Rooms of a package by layer, top first, as its import contract orders them; empty where there is none."""
    for contract in PYPROJECT["tool"]["importlinter"]["contracts"] if contracts is None else contracts:
        if contract["type"] != "layers":
            continue
        prefix = "" if contract.get("containers") == [package] else f"{package}."
        named = [re.split(r"\s*[|:]\s*", layer.strip()) for layer in contract["layers"]]
        if contract.get("containers", [package]) == [package] and all(n.startswith(prefix) for n in chain(*named)):
            return [tuple(sorted(name.strip("()").removeprefix(prefix) for name in each)) for each in named]
    return []


def beside(package: str) -> list[str]:
    """Rooms that the contract does not order: those that import others first."""
    left, ordered = rooms(package) - set(chain(*layers(package))), list[str]()
    while left:
        needed = set[str]().union(*(imports(package, room) - {room} for room in left))
        ordered += sorted(left - needed) or sorted(left)
        left -= set(ordered)
    return ordered


def imports(package: str, room: str) -> set[str]:
    """Rooms of the same package that a room imports from."""
    place = ROOT / package / room
    files = place.rglob("*.py") if place.is_dir() else [place.with_suffix(".py")]
    names = re.compile(rf"^\s*(?:from|import) {package}\.(\w+)", flags=re.MULTILINE)
    return {name for file in files for name in names.findall(file.read_text(encoding="utf-8"))} - {room}


# ---- The page


def section(page: str, title: str) -> str:
    """The text under a heading, up to the next one of its rank or above."""
    found = re.search(rf"^(#+) {re.escape(title)}\n", page, flags=re.MULTILINE)
    if not found:
        return ""
    return re.split(rf"^#{{1,{len(found[1])}}} ", page[found.end() :], maxsplit=1, flags=re.MULTILINE)[0]


def rows(page: str, title: str) -> list[str]:
    """Names in the first column of the table under a heading."""
    names = re.findall(r"^\| (`.*?`) \|", section(page, title), flags=re.MULTILINE)
    return [name for cell in names for name in re.findall(r"`(\w+)`", cell)]


def faults_of_rooms(page: str, package: str, order: Layers) -> list[str]:
    """Rooms that are missing, listed twice, unknown, or not in the order of the layers."""
    listed, real = rows(page, package), rooms(package)
    times = {room: listed.count(room) for room in sorted(real)}
    faults = [f"{package}.{room} is listed {count} times" for room, count in times.items() if count != 1]
    faults += [f"{package}.{room} does not exist" for room in listed if room not in real]
    depth = {room: number for number, layer in enumerate(order) for room in layer}
    depths = [depth.get(room, len(order)) for room in listed]
    pairs = zip(listed[1:], depths[1:], depths, strict=False)
    return faults + [f"{package}.{room} stands below a lower layer" for room, own, above in pairs if own < above]


def faults_of_names(text: str, root: Path = ROOT) -> list[str]:
    """Files and folders that the text names but that do not exist, and names that their files do not define.

    `<name>` in a path stands for any: the new file has neighbours there.
    """
    faults = []
    for path, name in re.findall(r"`((?:flexmb|crosscheck|tests|docs|cases|\.ci)/[\w./<>-]*)(?::(\w+))?`", text):
        if not any(root.glob(re.sub(r"<\w+>", "*", path).rstrip("/"))):
            faults.append(f"{path} does not exist")
        elif name and not _defines((root / path).read_text(encoding="utf-8"), name):
            faults.append(f"{path} does not define {name}")
    return faults


def _defines(source: str, name: str) -> bool:
    return bool(re.search(rf"^\s*(?:def|class) {name}\b|^{name}\b.*=", source, flags=re.MULTILINE))


def recipe(page: str, what: str) -> str:
    """The paragraph that says how to add something."""
    found = re.search(rf"^\*\*Add {what}\.\*\*.*?(?=\n\n|\Z)", section(page, "Recipes"), flags=re.MULTILINE | re.DOTALL)
    return found[0] if found else ""


def shared_letters() -> set[str]:
    """Names of one or two letters that compiled functions of several rooms take."""
    places = defaultdict[str, set[str]](set)
    for file in (ROOT / "flexmb").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and any(_compiles(each) for each in node.decorator_list):
                for argument in node.args.args:
                    places[argument.arg].add(file.relative_to(ROOT / "flexmb").parts[0])
    return {name for name, found in places.items() if len(name) <= 2 and len(found) >= SHARED}


def _compiles(decorator: ast.expr) -> bool:
    return ast.unparse(decorator).partition("(")[0] in ("kernel", "helper", "part")


# ---- The picture

WIDTH, ROW, GAP, MARGIN = 260, 26, 6, 16
STYLE = (
    "text{font:13px sans-serif;fill:#222}.h{font-weight:bold}.s{font-size:11px;fill:#666}"
    "rect{fill:#e8eef7;stroke:#8aa3c8}.b rect{fill:#f3efe4;stroke:#c8b88a}path{stroke:#555;fill:none}"
)


class Column(NamedTuple):
    """A column of the picture: its heading, what is small under it, rows of rooms, and notes beside single rooms."""

    title: str
    note: str
    rows: Layers
    notes: dict[str, str]


def picture() -> str:
    """Rooms in layers, as SVG: a room imports only from lower layers; those beside the layers say from where."""
    columns = []
    for package in PACKAGES:
        order, others = layers(package), beside(package)
        notes = {room: ", ".join(sorted(imports(package, room) & set(others))) for room in others}
        if order:
            columns.append(Column(package, "imports go down only", order, {}))
        if others:
            columns.append(Column(package, "beside the layers", [(room,) for room in others], notes))
    height = MARGIN * 2 + 2 * ROW + max(len(each.rows) for each in columns) * (ROW + GAP)
    pitch = WIDTH + 2 * MARGIN
    width = MARGIN + len(columns) * pitch
    drawn = [line for number, each in enumerate(columns) for line in _column(each, MARGIN + number * pitch)]
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}">'
    return "\n".join([head, f"<style>{STYLE}</style>", *drawn, "</svg>", ""])


def _column(column: Column, x: int) -> list[str]:
    y = MARGIN + 2 * ROW
    lines = [_text(x, MARGIN + 12, column.title, "h"), _text(x, MARGIN + 28, column.note, "s")]
    lines.append('<g class="b">' if column.notes else "<g>")
    for number, names in enumerate(column.rows):
        top, each = y + number * (ROW + GAP), (WIDTH - GAP * (len(names) - 1)) / len(names)
        for place, name in enumerate(names):
            left = x + place * (each + GAP)
            lines.append(f'<rect x="{left:g}" y="{top}" width="{each:g}" height="{ROW}" rx="4"/>')
            lines.append(_text(left + 8, top + 17, name, ""))
        if column.notes.get(names[0]):
            lines.append(_text(x + 90, top + 17, f"imports {column.notes[names[0]]}", "s"))
    if not column.notes:
        end = y + len(column.rows) * (ROW + GAP) - GAP
        lines.append(f'<path d="M{x + WIDTH + 10} {y} V{end} m-4 -8 l4 8 l4 -8"/>')
    return [*lines, "</g>"]


def _text(x: float, y: int, text: str, kind: str) -> str:
    return f'<text x="{x:g}" y="{y}"' + (f' class="{kind}"' if kind else "") + f">{text}</text>"


if __name__ == "__main__":
    PICTURE.write_text(picture(), encoding="utf-8")
