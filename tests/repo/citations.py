"""Citations of numbered equations, read from the docstrings and comments of functions and classes.

A citation is a number or a range in parentheses: "(107)", "(98), (99)", "(129)-(134)", and "(A4)" for a paper whose
appendices number theirs so. In a paper's own folders every one counts that does not stand behind the name of another
paper; elsewhere those that stand behind its name, as in "Frisch (48)" and "Frisch's (47), (49)". What stands in a
module, outside its functions and classes, is read for numbers that do not exist, but cites nothing: an equation belongs
to the function that does it.
"""

import ast
import io
import re
import tokenize
from dataclasses import dataclass
from pathlib import Path

_NUMBER = r"\([A-Z]?\d{1,3}\)"
_ITEM = rf"{_NUMBER}(?:(?:\s*[-\u2013]\s*|\s+to\s+){_NUMBER})?"  # a number or a range
_LIST = rf"{_ITEM}(?:(?:,?\s+and\s+|[,;]\s*){_ITEM})*"
_FREE_ITEM = re.compile(rf"(?<![\w\])]){_ITEM}")  # not the argument of a function


@dataclass(frozen=True)
class Sources:
    """How a paper is cited: bare numbers in `folders`, behind `names` elsewhere, behind `other_names` nowhere.

    `letters` are those of appendices whose equations are numbered; a number with another letter is no citation.
    """

    folders: tuple[str, ...]
    names: tuple[str, ...]
    other_names: tuple[str, ...]
    letters: tuple[str, ...] = ()


@dataclass(frozen=True, order=True)
class Place:
    """A function or class: its file relative to the repository and its qualified name, empty for the module."""

    path: str
    name: str

    @property
    def is_test(self) -> bool:
        """Whether pytest runs it: a function `test_*` in a file `test_*.py`."""
        function = self.name.rpartition(".")[2]
        return Path(self.path).name.startswith("test_") and function.startswith("test_")


def numbers(text: str, sources: Sources, in_folder: bool) -> dict[str, bool]:
    """Equation numbers that a text cites, and whether each is named by itself, not only in a range."""
    if in_folder:
        passages = [_behind(sources.other_names).sub("", text)]
    else:
        passages = [match[0] for match in _behind(sources.names).finditer(text)]
    found: dict[str, bool] = {}
    for passage in passages:
        for item in _FREE_ITEM.findall(passage):
            ends = re.findall(r"([A-Z]?)(\d+)", item)
            letter = ends[0][0]
            if letter and letter not in sources.letters:
                continue
            for n in range(int(ends[0][1]), int(ends[-1][1]) + 1):
                label = f"{letter}{n}"
                found[label] = len(ends) == 1 or found.get(label, False)
    return found


def _behind(names: tuple[str, ...]) -> re.Pattern[str]:
    """A list of numbers behind one of the names."""
    spelled = "|".join(re.escape(name).replace(r"\ ", r"\s+") for name in names)
    return re.compile(rf"(?<!\w)(?:{spelled})(?:'s)?\s+{_LIST}")


def texts(source: str) -> dict[str, str]:
    """Docstring and comments of a module (name ""), its classes and its functions, by qualified name."""
    found: dict[str, list[str]] = {}
    owner: dict[int, str] = {}  # of each line: the innermost function or class

    def visit(node: ast.AST, prefix: str) -> None:
        for child in ast.iter_child_nodes(node):
            inner = prefix
            if isinstance(child, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                inner = f"{prefix}.{child.name}" if prefix else child.name
                found[inner] = [ast.get_docstring(child) or ""]
                owner.update(dict.fromkeys(range(child.lineno, (child.end_lineno or child.lineno) + 1), inner))
            visit(child, inner)

    tree = ast.parse(source)
    found[""] = [ast.get_docstring(tree) or ""]
    visit(tree, "")
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            found[owner.get(token.start[0], "")].append(token.string.lstrip("# "))
    return {name: "\n".join(parts) for name, parts in found.items()}


def citations(root: Path, sources: Sources, packages: tuple[str, ...]) -> dict[Place, dict[str, bool]]:
    """What every function, class and module below root/packages cites; those that cite nothing are left out."""
    cited: dict[Place, dict[str, bool]] = {}
    for package in packages:
        for path in sorted((root / package).rglob("*.py")):
            relative = path.relative_to(root).as_posix()
            in_folder = any(relative.startswith(f"{folder}/") for folder in sources.folders)
            source = path.read_text(encoding="utf-8")
            if not in_folder and not any(name.split()[0] in source for name in sources.names):
                continue  # before it is parsed
            for name, text in texts(source).items():
                if found := numbers(text, sources, in_folder):
                    cited[Place(relative, name)] = found
    return cited
