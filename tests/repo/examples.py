"""docs/examples.md, a gallery of the scripts and the notebook in `examples/`: what each shows, its picture, its code.

    python -m tests.repo.examples            # run all, write their pictures and the page
    python -m tests.repo.examples 03 07      # draw only those anew whose names begin so

The page is made of the files alone; the first paragraph of a file is its title, the second says what it shows.
"""

import ast
import json
import os
import re
import runpy
import sys
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import matplotlib
import matplotlib.pyplot as plt

from tests.repo.project import ROOT

FOLDER = ROOT / "examples"
PAGE = ROOT / "docs" / "examples.md"
PICTURES = ROOT / "docs" / "pictures" / "examples"
ACROSS = 3  # pictures in a row
INTRODUCTION = """# Examples

Short scripts with one idea each, in `examples/`: run one, change it, run it again. Each writes its picture into the
folder in which it is run, checks what it says, and prints what it found and wrote. This page is generated:
`python -m tests.repo.examples`.

<!-- not run: it would write a picture into the repository -->
```sh
cd examples && python 01_first_pendulum.py
```
"""


class Example(NamedTuple):
    """A script or notebook: `text` says what it shows, `code` is Python, cell by cell for a notebook."""

    file: Path
    title: str
    text: str
    code: list[str]

    @property
    def picture(self) -> str:
        """Name of the picture that it writes."""
        return f"{self.file.stem}.svg"

    def run(self, folder: Path) -> None:
        """Run it in a folder, as its reader would, with the look of `examples/matplotlibrc`."""
        with chdir(folder), matplotlib.rc_context(fname=str(FOLDER / "matplotlibrc")):
            plt.switch_backend("svg")
            try:
                if self.file.suffix == ".py":
                    runpy.run_path(str(self.file), run_name="__main__")
                else:
                    _run_cells(self)
            finally:
                plt.close("all")


def examples() -> list[Example]:
    """All of them, in the order of the gallery."""
    return [
        _script(file) if file.suffix == ".py" else _notebook(file)
        for file in sorted(FOLDER.iterdir())
        if file.suffix in (".py", ".ipynb")
    ]


def page() -> str:
    """The text of docs/examples.md."""
    found = examples()
    rows = [found[first : first + ACROSS] for first in range(0, len(found), ACROSS)]
    table = [_row([_thumbnail(each) for each in row]) for row in rows]
    head = [_row([""] * ACROSS), "|" + ACROSS * ":-:|"]
    return "\n".join([INTRODUCTION, *head, *table, "", *(_section(each) for each in found)])


def _script(file: Path) -> Example:
    source = file.read_text(encoding="utf-8")
    title, text = (ast.get_docstring(ast.parse(source)) or "").split("\n\n", 1)
    return Example(file, title, " ".join(text.split()), [source.split('"""\n', 1)[1].strip() + "\n"])


def _notebook(file: Path) -> Example:
    cells = json.loads(file.read_text(encoding="utf-8"))["cells"]
    title, text = "".join(cells[0]["source"]).split("\n\n", 1)
    code = ["".join(cell["source"]) + "\n" for cell in cells if cell["cell_type"] == "code"]
    return Example(file, title.removeprefix("# "), " ".join(text.split()), code)


def _run_cells(notebook: Example) -> None:
    """One after the other, in one namespace, as a kernel does."""
    names: dict[str, object] = {"__name__": "__main__"}
    for number, code in enumerate(notebook.code, 1):
        exec(compile(code, f"{notebook.file.name}, code cell {number}", "exec"), names)


def _thumbnail(example: Example) -> str:
    anchor = re.sub(r"[^\w\- ]", "", example.title.lower()).replace(" ", "-")
    return f"[![{example.title}](pictures/examples/{example.picture})<br>{example.title}](#{anchor})"


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(cells + [''] * (ACROSS - len(cells)))} |"


def _section(example: Example) -> str:
    name = example.file.relative_to(ROOT).as_posix()
    code = "\n".join(example.code)
    return (
        f"## {example.title}\n\n{example.text}\n\n![{example.title}](pictures/examples/{example.picture})\n\n"
        f"`{name}`:\n\n<!-- not run: tests/test_examples.py runs the file -->\n```python\n{code}```\n"
    )


def main(names: list[str]) -> None:
    """Run examples, all by default; keep their pictures and write the page."""
    os.environ["SOURCE_DATE_EPOCH"] = "0"  # the same picture is the same file, whenever it is drawn
    os.environ.setdefault("FLEXMB_KERNELS", "general")
    PICTURES.mkdir(exist_ok=True)
    for example in examples():
        if not names or example.file.name.startswith(tuple(names)):
            with TemporaryDirectory() as folder:
                example.run(Path(folder))
                (PICTURES / example.picture).write_bytes((Path(folder) / example.picture).read_bytes())
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
