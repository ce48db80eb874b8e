"""Writer of SID files: all blocks, with 17 digits, without the elements that are zero."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import assert_never

import numpy as np

from flexmb.interchange.sid.blocks import Sid, SidNode, Taylor, node_shapes, shapes
from flexmb.interchange.sid.dialect import Dialect, by_axis, six_of_inertia
from flexmb.output.whole import write_whole

GENERAL = 3  # "structure" of a full matrix


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
