"""docs/architecture.md against the tree and the import contracts, and its picture, which is drawn from them by

python -m tests.repo.architecture
"""

import ast
import re
from collections import defaultdict
from pathlib import Path
from typing import Any

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
    """Rooms of a package by layer, top first, as the import contract that contains the package orders them."""
    for contract in PYPROJECT["tool"]["importlinter"]["contracts"] if contracts is None else contracts:
        if contract["type"] == "layers" and contract.get("containers") == [package]:
            return [tuple(sorted(re.findall(r"\w+", layer))) for layer in contract["layers"]]
    return []


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
ABREAST = 3  # rooms in a row: names of more would be printed over each other
STYLE = (
    "text{font:13px sans-serif;fill:#222}.h{font-weight:bold}.s{font-size:11px;fill:#666}"
    "rect{fill:#e8eef7;stroke:#8aa3c8}path{stroke:#555;fill:none}"
)


def picture() -> str:
    """Rooms in layers, as SVG: a room imports only from lower layers; a large layer has several rows."""
    ordered = {package: layers(package) for package in PACKAGES}
    lines = (sum(map(len, map(_abreast, order))) for order in ordered.values())
    height = MARGIN * 2 + 2 * ROW + max(lines) * (ROW + GAP)
    pitch = WIDTH + 2 * MARGIN
    width = MARGIN + len(ordered) * pitch
    columns = enumerate(ordered.items())
    drawn = [line for number, (name, order) in columns for line in _column(name, order, MARGIN + number * pitch)]
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}">'
    return "\n".join([head, f"<style>{STYLE}</style>", *drawn, "</svg>", ""])


def _column(package: str, order: Layers, x: int) -> list[str]:
    y = MARGIN + 2 * ROW
    lines = [_text(x, MARGIN + 12, package, "h"), _text(x, MARGIN + 28, "imports go down only", "s")]
    for layer in order:
        for names in _abreast(layer):
            each = (WIDTH - GAP * (len(names) - 1)) / len(names)
            for place, name in enumerate(names):
                left = x + place * (each + GAP)
                lines.append(f'<rect x="{left:g}" y="{y}" width="{each:g}" height="{ROW}" rx="4"/>')
                lines.append(_text(left + 8, y + 17, name, ""))
            y += ROW + GAP
    end = y - GAP
    return [*lines, f'<path d="M{x + WIDTH + 10} {MARGIN + 2 * ROW} V{end} m-4 -8 l4 8 l4 -8"/>']


def _abreast(layer: tuple[str, ...]) -> list[tuple[str, ...]]:
    """The rooms of a layer in rows of at most `ABREAST`, as equal as can be."""
    count = -(-len(layer) // ABREAST)
    return [layer[len(layer) * row // count : len(layer) * (row + 1) // count] for row in range(count)]


def _text(x: float, y: int, text: str, kind: str) -> str:
    return f'<text x="{x:g}" y="{y}"' + (f' class="{kind}"' if kind else "") + f">{text}</text>"


if __name__ == "__main__":
    PICTURE.write_text(picture(), encoding="utf-8")
