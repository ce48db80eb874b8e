"""Reader and writer of SID files of two dialects, and how to tell these apart.

"wallrapp": J is a 3 x 3 matrix, and the columns of Gr and Ge are ordered by mode, then axis, as in the textbooks.
"fembs": J is the vector xx, yy, zz, xy, xz, yz, and the columns are ordered by axis, then mode, as FEMBS and programs
after it write them. Files do not say which order theirs is; the redundancy of Gr and Ge with J and Cr does.

Fortran exponents, any letter case, comments, blank lines, and blocks in any order are read; all blocks are written,
with 17 digits, without the elements that are zero.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal, NamedTuple, NoReturn, assert_never

import numpy as np

from flexmb.interchange.imported import MAGNITUDE, usable
from flexmb.interchange.sid.blocks import Sid, SidError, SidNode, Taylor, node_shapes, shapes
from flexmb.modal.first_order import symmetric
from flexmb.output.files import write_whole
from flexmb.scene.quaternions import cross_matrix
from flexmb.scene.reading import MIB, Unreadable, read_text
from flexmb.typing import Index, Real

Dialect = Literal["wallrapp", "fembs"]
SIX = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""The elements of J in a vector of six."""


def inertia_of_six(six: Taylor) -> Taylor:
    """J (3,3) from its vector (6,1)."""

    def matrix(vector: Real) -> Real:
        J = np.zeros((*vector.shape[:-1], 3, 3))
        for place, (i, j) in enumerate(SIX):
            J[..., i, j] = J[..., j, i] = vector[..., place]
        return J

    first = None if six.first is None else np.moveaxis(matrix(six.first[:, :, 0].T), 0, 1)
    return Taylor(matrix(six.zero[:, 0]), first)


def six_of_inertia(J: Taylor) -> Taylor:
    """The vector (6,1) of J (3,3)."""
    rows, columns = np.array(SIX).T
    first = None if J.first is None else J.first.transpose(0, 2, 1)[rows, columns][:, :, None]
    return Taylor(J.zero[rows, columns][:, None], first)


def by_axis(block: Taylor) -> Taylor:
    """Gr or Ge with columns by mode, then axis, as one with columns by axis, then mode."""
    return _reordered(block, np.arange(block.zero.shape[1]).reshape(-1, 3).T.ravel())


def by_mode(block: Taylor) -> Taylor:
    """The inverse of `by_axis`."""
    return _reordered(block, np.arange(block.zero.shape[1]).reshape(3, -1).T.ravel())


def _reordered(block: Taylor, order: Index) -> Taylor:
    return Taylor(block.zero[:, order], None if block.first is None else block.first[:, :, order])


def with_columns_by_mode(J: Taylor, Cr: Taylor, Gr: Taylor, Ge: Taylor) -> tuple[Taylor, Taylor]:
    """Gr and Ge of a file, whose columns have either order, with columns by mode.

    The order is the one in which they agree better with J and Cr; columns by mode if there is no difference.
    """
    other = by_mode(Gr), by_mode(Ge)
    return other if _gap(J, Cr, *other) < _gap(J, Cr, Gr, Ge) else (Gr, Ge)


def _gap(J: Taylor, Cr: Taylor, Gr: Taylor, Ge: Taylor) -> float:
    """By how much Gr and Ge, of columns by mode, contradict J and Cr: a sum of relative differences."""
    m = len(Cr.zero)
    torque = Gr.zero.reshape(3, m, 3).swapaxes(0, 1)
    force = Ge.zero.reshape(m, m, 3)
    pairs = [(0.5 * (torque - np.swapaxes(torque, 1, 2)), -cross_matrix(Cr.zero)), (force, -np.swapaxes(force, 0, 1))]
    if J.first is not None:
        pairs.append((symmetric(torque), np.moveaxis(J.first, 1, 0)))
    if Cr.first is not None:
        pairs.append((force, Cr.first - np.swapaxes(Cr.first, 0, 1)))
    sizes = ((float(np.linalg.norm(a - b)), float(np.linalg.norm(a) + np.linalg.norm(b))) for a, b in pairs)
    return sum(gap / size for gap, size in sizes if size > 0.0)


LIMIT = 256 * MIB
LARGEST = 2**26  # numbers in one block
OPTIONAL = ("ksigma", "De", "sigma", "psi", "AP")  # zero (AP: the unit matrix) if a file does not have them
ZEROS, DIAGONAL, SYMMETRIC, GENERAL, UNIT = range(5)  # "structure"
STATEMENT = re.compile(r"([A-Za-z_]\w*)\s*(?:\(([^)]*)\))?\s*(?:=\s*(.*))?$")


class SidLine(NamedTuple):
    """A statement: its first word as written and, as `key`, in lower case; indices; text after "="."""

    number: int
    word: str
    indices: tuple[int, ...]
    value: str

    @property
    def key(self) -> str:
        return self.word.lower()


def read_sid(path: str | os.PathLike[str]) -> Sid:
    """Read a SID file. Raises SidError with file, line and remedy, or OSError."""
    try:
        text = read_text(path, LIMIT)
    except Unreadable as error:
        raise SidError(f"{path}: {error}") from None
    return _Reader(str(path), text).body()


class _Reader:
    """The statements of one file, read in sequence."""

    def __init__(self, file: str, text: str) -> None:
        self.file = file
        self.lines = self._statements(text)
        self.line = SidLine(0, "", (), "")
        self.modes = 0

    def body(self) -> Sid:
        """The first modal body of the file."""
        self._find("refmod", "it has no block refmod: is it a SID file of a modal body?")
        mass, names = self._refmod()
        self.modes = len(names)
        nodes: list[SidNode] = []
        blocks: dict[str, Taylor] = {}
        known = {name.lower(): name for name in shapes(self.modes)}
        while (line := self._next("end modal or end part")).key != "end":
            if line.key == "frame":
                nodes = self._frame()
            elif line.key in known:
                blocks[self._new(known[line.key], blocks)] = self._taylor(known[line.key], shapes(self.modes))
            else:
                self._fail(
                    f'"{line.word}" is not a block of a modal body', f"blocks are frame, {', '.join(known.values())}"
                )
        whole = self._complete(blocks, shapes(self.modes), "the body")
        whole["Gr"], whole["Ge"] = with_columns_by_mode(*(whole[name] for name in ("J", "Cr", "Gr", "Ge")))
        return Sid(mass=mass, modes=names, nodes=tuple(nodes), **whole, file=self.file)

    def _refmod(self) -> tuple[float, tuple[str, ...]]:
        mass, count, names = math.nan, -1, {}
        while (line := self._next("end refmod")).key != "end":
            match line.key:
                case "mass":
                    mass = self._real(line.value)
                case "nelastq":
                    count = self._whole(line.value)
                case "ielastq" if len(line.indices) == 1:
                    names[line.indices[0]] = line.value.strip().strip("'\"")
                case _:
                    self._fail(f'"{line.word}" does not belong to refmod', "it has mass, nelastq and ielastq(k)")
        if not mass > 0.0:
            self._fail("refmod gives no mass above zero", "add mass = ... in kg")
        if not 0 <= count <= LARGEST:
            self._fail("refmod does not give the number of modes", "add nelastq = ...")
        if count > len(names) and math.prod((count, count)) > LARGEST:
            self._fail(f"nelastq = {count} modes would not fit into memory", "correct nelastq")
        return mass, tuple(names.get(k, f"mode {k}") for k in range(1, count + 1))

    def _frame(self) -> list[SidNode]:
        nodes: list[SidNode] = []
        while (line := self._next("end frame")).key != "end":
            if line.key != "new":
                self._fail(f'"{line.word}" is not the start of a node', "write new node = NAME")
            name = line.value.strip().strip("'\"")
            if not name or name in [node.name for node in nodes]:
                self._fail(f'the node name "{name}" is empty or repeated', "give every node a name of its own")
            nodes.append(self._node(name))
        return nodes

    def _node(self, name: str) -> SidNode:
        blocks: dict[str, Taylor] = {}
        known = {key.lower(): key for key in node_shapes(self.modes)}
        while (line := self._next("end node")).key != "end":
            if line.key == "rframe":
                continue
            if line.key not in known:
                self._fail(f'"{line.word}" is not a block of a node', f"blocks are {', '.join(known.values())}")
            blocks[self._new(known[line.key], blocks)] = self._taylor(known[line.key], node_shapes(self.modes))
        return SidNode(name, **self._complete(blocks, node_shapes(self.modes), f"node {name}"))

    def _taylor(self, name: str, expected: dict[str, tuple[int, int]]) -> Taylor:
        """A block, with what its structure leaves out."""
        start = self.line.number
        head, elements = self._block(name)
        shape = self._shape(name, expected[name], head, start)
        structure = head.get("structure", GENERAL)
        zero = np.eye(*shape) if structure == UNIT else np.zeros(shape)
        first = None
        if head.get("order", 0) == 1 or any(line.key == "m1" for line, _ in elements):
            if zero.size * self.modes > LARGEST:
                self._fail(f"{name} would not fit into memory", "correct nelastq")
            first = np.zeros((shape[0], self.modes, shape[1]))
        for line, value in elements:
            self._put(name, line, value, zero if line.key == "m0" else first)
        if structure == SYMMETRIC:
            zero = _mirrored(zero)
            if first is not None:
                first = np.stack([_mirrored(part) for part in np.moveaxis(first, 1, 0)], axis=1)
        if zero.shape != expected[name] and name == "J":
            return inertia_of_six(Taylor(zero, first))
        return Taylor(
            zero.reshape(expected[name]), first if first is None else first.reshape(expected[name][0], self.modes, -1)
        )

    def _block(self, name: str) -> tuple[dict[str, int], list[tuple[SidLine, float]]]:
        """The whole numbers at the head of a block, and its elements."""
        head, elements = dict[str, int](), list[tuple[SidLine, float]]()
        while (line := self._next(f"end {name}")).key != "end":
            if line.key in ("m0", "m1"):
                elements.append((line, self._real(line.value)))
            elif line.key in ("order", "nrow", "ncol", "nq", "nqn", "structure"):
                head[line.key] = self._whole(line.value)
            else:
                self._fail(f'"{line.word}" does not belong to {name}', "it has order, nrow, ..., m0(i,j), m1(i,k,j)")
        return head, elements

    def _shape(self, name: str, expected: tuple[int, int], head: dict[str, int], start: int) -> tuple[int, int]:
        """Rows and columns as a block is written that starts in that line: stresses may be a row, J a vector of six."""
        rows, columns = expected
        given = (head.get("nrow", rows), head.get("ncol", columns))
        if (name, *given) in (("ksigma", 1, self.modes), ("J", 6, 1)):
            rows, columns = given
        structure, order = head.get("structure", GENERAL), head.get("order", 0)
        if structure != ZEROS and given != (rows, columns) or structure not in range(5) or order not in (0, 1):
            self.line = self.line._replace(number=start)
            what = f"{name} is {given[0]} x {given[1]} of structure {structure}, order {order}"
            either = " or 6 x 1" if name == "J" else ""
            self._fail(what, f"it has to be {rows} x {columns}{either}, of structure 0 to 4, order 0 or 1")
        return rows, columns

    def _put(self, name: str, line: SidLine, value: float, target: Real | None) -> None:
        """An element into m0, or into m1, which is there where the block has an element of it."""
        assert target is not None
        is_inside = len(line.indices) == target.ndim and all(
            1 <= i <= n for i, n in zip(line.indices, target.shape, strict=True)
        )
        if not is_inside:
            self.line = line
            size = " x ".join(map(str, target.shape))
            self._fail(f"{line.key}{line.indices} is not an element of {name} ({size})", "correct its indices")
        target[tuple(i - 1 for i in line.indices)] = value

    def _complete(self, found: dict[str, Taylor], expected: dict[str, tuple[int, int]], of: str) -> dict[str, Taylor]:
        for name, shape in expected.items():
            if name not in found and name in OPTIONAL:
                found[name] = Taylor(np.eye(3) if name == "AP" else np.zeros(shape))
            elif name not in found:
                self._fail(f"{of} has no block {name}", "add it, with structure = 0 if it is zero")
        return found

    def _new(self, name: str, found: dict[str, Taylor]) -> str:
        if name in found:
            self._fail(f"{name} is repeated", "keep one of them")
        return name

    # Statements and numbers

    def _statements(self, text: str) -> Iterator[SidLine]:
        """All statements; lines before "part" are a title."""
        started = False
        for number, raw in enumerate(text.split("\n"), 1):
            stripped = raw.strip()
            started = started or stripped.lower().split(maxsplit=1)[:1] in (["part"], ["new"], ["refmod"])
            text_value = stripped.lower().startswith("ielastq")
            stripped = stripped if text_value else re.split(r"[%!#]", stripped, maxsplit=1)[0].strip()
            if not started or not stripped:
                continue
            first = stripped.split(maxsplit=1)
            if first[0].lower() == "new" and "=" in stripped:
                yield SidLine(number, "new", (), stripped.partition("=")[2])
            elif first[0].lower() in ("end", "new"):
                yield SidLine(number, first[0], (), first[1] if len(first) > 1 else "")
            elif (found := STATEMENT.match(stripped)) is not None:
                word, indices, value = found.groups()
                self.line = SidLine(number, word, (), value or "")
                yield self.line._replace(indices=tuple(self._whole(i) for i in indices.split(",")) if indices else ())
            else:
                self.line = SidLine(number, stripped, (), "")
                self._fail(f'"{stripped[:60]}" is not a statement', "write KEY = VALUE, or the name of a block")

    def _next(self, until: str) -> SidLine:
        line = next(self.lines, None)
        if line is None:
            self._fail(f"the file ends before {until}", "the file is cut off, or an end is missing: write it again")
        self.line = line
        return line

    def _find(self, key: str, otherwise: str) -> None:
        for line in self.lines:
            self.line = line
            if line.key == key:
                return
        self._fail(otherwise, "give a file that begins with part, new modal, refmod")

    def _real(self, text: str) -> float:
        try:
            value = float(text.strip().lower().replace("d", "e"))
        except ValueError:
            value = math.nan
        if not usable(value):
            what = f'"{text.strip()[:40]}" is not a finite number up to {MAGNITUDE:g}'
            self._fail(what, "write it as 1.5, 1.5E-3 or 1.5D-3")
        return value

    def _whole(self, text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            self._fail(f'"{text.strip()[:40]}" is not a whole number', "correct it")
        return value

    def _fail(self, what: str, remedy: str) -> NoReturn:
        raise SidError(f"{self.file}, line {self.line.number}: {what}: {remedy}")


def _mirrored(a: np.ndarray) -> np.ndarray:
    """A symmetric matrix, one half of which may be missing."""
    return np.where(a == 0.0, a.T, a)


def write_sid(sid: Sid, path: str | os.PathLike[str], dialect: Dialect = "wallrapp") -> None:
    """Write a SID file, in which the body has the name of the file, in one of the two dialects of `sid.dialect`."""
    match dialect:
        case "wallrapp":
            written = sid
        case "fembs":
            written = replace(sid, J=six_of_inertia(sid.J), Gr=by_axis(sid.Gr), Ge=by_axis(sid.Ge))
        case _:
            assert_never(dialect)
    write_whole(Path(path), "\n".join(_lines(written, " ".join(Path(path).stem.split()))) + "\n")


def _lines(sid: Sid, name: str) -> Iterator[str]:
    m = len(sid.modes)
    yield f"{len(sid.nodes)} {m} : number of nodes, number of modes"
    yield "part"
    yield f"  new modal = {name}"
    yield "    refmod"
    yield f"      mass = {sid.mass:.17g}"
    yield f"      nelastq = {m}"
    for number, name in enumerate(sid.modes, 1):
        yield f"      ielastq({number}) = {name}"
    yield "    end refmod"
    yield "    frame"
    for node in sid.nodes:
        yield from _node(node, m)
    yield "    end frame"
    for block in shapes(m):
        yield from _taylor(block, getattr(sid, block), "    ")
    yield "  end modal"
    yield "end part"


def _node(node: SidNode, m: int) -> Iterator[str]:
    yield f"      new node = {node.name}"
    yield "        rframe = body ref"
    for block in node_shapes(m):
        yield from _taylor(block, getattr(node, block), "        ")
    yield "      end node"


def _taylor(name: str, block: Taylor, indent: str) -> Iterator[str]:
    rows, columns = block.zero.shape
    yield f"{indent}{name}"
    head = {
        "order": 0 if block.first is None else 1,
        "nrow": rows,
        "ncol": columns,
        "nq": 0 if block.first is None else block.first.shape[1],
        "nqn": 0,
        "structure": GENERAL,
    }
    for key, value in head.items():
        yield f"{indent}  {key} = {value}"
    for i, j in np.argwhere(block.zero):
        yield f"{indent}  m0({i + 1},{j + 1}) = {block.zero[i, j]:.17g}"
    if block.first is not None:
        for i, k, j in np.argwhere(block.first):
            yield f"{indent}  m1({i + 1},{k + 1},{j + 1}) = {block.first[i, k, j]:.17g}"
    yield f"{indent}end {name}"
