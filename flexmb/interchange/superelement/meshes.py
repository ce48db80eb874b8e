"""Nodes from input files of finite-element codes: GRID cards of Nastran, *NODE of Abaqus and CalculiX."""

from __future__ import annotations

from typing import NamedTuple

from flexmb.interchange.imported import MAGNITUDE, usable
from flexmb.interchange.superelement.element import SuperElementError
from flexmb.interchange.superelement.nastran import cards, real


class Nodes(NamedTuple):
    """ids, positions (n,3) m, and the digits of each node's displacements: "" if the file does not say them."""

    ids: list[int]
    position: list[list[float]]
    dofs: list[str]


def grid_nodes(file: str, text: str) -> Nodes:
    """Nodes of the GRID cards, in the basic system. SuperElementError with file, line and remedy."""
    nodes = Nodes([], [], [])
    for number, fields in cards(text, "GRID"):
        fields = [*fields, *[""] * 7][:7]
        if any(word not in ("", "0", "-1") for word in (fields[2], fields[6])):
            raise SuperElementError(
                f"{file}, line {number}: node {fields[1]} is in another coordinate system: write nodes and their "
                "displacements in the basic one (fields 3 and 7 of GRID)"
            )
        try:
            _add(nodes, number_of_node(fields[1]), [real(word) if word else 0.0 for word in fields[3:6]])
        except ValueError:
            raise SuperElementError(f"{file}, line {number}: GRID needs a number and three coordinates") from None
    return nodes


def inp_nodes(file: str, text: str) -> Nodes:
    """Nodes of *NODE in a flat input file. SuperElementError with file, line and remedy."""
    found, inside = Nodes([], [], []), False
    for number, line in enumerate(text.split("\n"), 1):
        if line.startswith("**") or not line.strip():
            continue
        if line.startswith("*"):
            keyword, *options = (word.strip().upper() for word in line.split(","))
            inside = keyword == "*NODE"
            if keyword in ("*INSTANCE", "*SYSTEM") or (inside and any(word.startswith("SYSTEM") for word in options)):
                raise SuperElementError(
                    f"{file}, line {number}: {keyword} moves nodes: write a flat input file, without parts and "
                    "instances, with nodes in the global system"
                )
        elif inside:
            words = [word.strip() for word in line.split(",")]
            try:
                place = [real(word) if word else 0.0 for word in (*words[1:4], "", "", "")][:3]
                _add(found, number_of_node(words[0]), place)
            except ValueError:
                raise SuperElementError(f"{file}, line {number}: a node is number, x, y, z: correct it") from None
    return found


def number_of_node(word: str) -> int:
    """A node number; ValueError unless it is an integer of 64 bits."""
    number = int(word)
    if not -(2**63) <= number < 2**63:
        raise ValueError(f"{word:.40} is too large")
    return number


def _add(found: Nodes, number: int, position: list[float]) -> None:
    if not all(map(usable, position)):
        raise ValueError(f"a coordinate is beyond {MAGNITUDE:g}")
    found.ids.append(number)
    found.position.append(position)
    found.dofs.append("")
