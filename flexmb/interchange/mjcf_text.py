"""Checks of the text of an MJCF model before MuJoCo compiles it: numbers that are not finite, and excessive counts.

MuJoCo interprets NaN as "not given" and uses a default, so that an error results in a wrong model with finite numbers.
It also makes as many copies as `count` specifies, whatever memory they need. Both can be seen only in the text of the
model and of all files that it includes.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree

from flexmb.interchange.imported import MAGNITUDE, ModelError, usable
from flexmb.scene.reading import MIB, Unreadable, read_text

LIMIT = 256 * MIB
COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)  # MuJoCo's reader takes "--" in them, which XML does not
NO_NUMBER = re.compile(r"[-+]?(nan(\(.*\))?|inf(inity)?)", re.IGNORECASE)
MOST_COPIES = 10_000  # total number of copied bodies; MuJoCo needs some 30 kB for each
MOST_ENTRIES = 100_000_000  # of a texture or a height field
MOST_RESERVED = 1_000_000  # user numbers for each item, and keyframes
# Attributes whose values are names or texts: a body may be called "inf".
TEXTS = frozenset((
    "name", "class", "childclass", "dclass", "model", "file", "content_type", "plugin", "instance", "key", "text",
    "target", "objname", "reftype", "refname", "objtype", "body", "body1", "body2", "bodyname", "bodyname1",
    "bodyname2", "geom", "geom1", "geom2", "geomname", "site", "site1", "site2", "sitename", "slidersite",
    "cranksite", "refsite", "joint", "joint1", "joint2", "jointinparent", "tendon", "tendon1", "tendon2", "actuator",
    "mesh", "hfield", "skin", "material", "texture", "flex", "node", "prefix", "source", "sidesite", "parent",
    "child", "link", "type", "filename", "fileup", "filedown", "fileleft", "fileright", "filefront", "fileback",
    "meshdir", "texturedir", "assetdir",
))  # fmt: skip
FOLLOWED = {"include": "file", "model": "file"}  # elements that refer to another MJCF file


def refuse_bad_text(path: Path) -> None:
    """Check a model and all files it includes. ModelError names file, element, attribute and remedy; OSError."""
    folders, seen = [path.parent], set[str]()
    waiting = [path]
    for file in waiting:
        if (real := os.path.realpath(file)) in seen:
            continue
        seen.add(real)
        root = _parsed(file)
        for element in root.iter("compiler"):
            folders += [path.parent / element.get(key, "") for key in ("assetdir", "meshdir") if element.get(key)]
        _refuse_elements(file, root)
        for named in _named_files(root):
            texts = (folder / named for folder in (*folders, file.parent))
            waiting += [path for path in texts if os.path.lexists(path)]  # MuJoCo reports missing files


def _parsed(file: Path) -> ElementTree.Element:
    try:
        text = read_text(file, LIMIT)
        if "<!ENTITY" in text:
            raise ModelError(f"{file}: it declares entities, which no model needs: remove them")
        return ElementTree.fromstring(COMMENT.sub("", text))
    except Unreadable as error:
        raise ModelError(f"{file}: {error}") from None
    except ElementTree.ParseError as error:
        raise ModelError(f"{file}: not XML ({error}): correct it there") from None


def _named_files(root: ElementTree.Element) -> Iterator[str]:
    for tag, key in FOLLOWED.items():
        for element in root.iter(tag):
            if named := element.get(key):
                yield named


def _refuse_elements(file: Path, root: ElementTree.Element) -> None:
    """Check all elements, each with the number of copies that the enclosing elements request."""
    waiting = [(root, 1)]
    while waiting:  # without recursion, because the nesting is limited only by the size of the file
        element, copies = waiting.pop()
        for key, text in element.attrib.items():
            if key not in TEXTS and element.tag != "text":
                _refuse_words(file, element, key, text)
        copies *= _copies(element)
        if copies > MOST_COPIES:
            _fail(file, element, "count", f"it requests {copies} copies, and the limit is {MOST_COPIES}", "reduce it")
        _refuse_sizes(file, element)
        waiting += [(child, copies) for child in element]


def _refuse_words(file: Path, element: ElementTree.Element, key: str, text: str) -> None:
    for word in text.split():
        if NO_NUMBER.fullmatch(word) or _is_too_large(word):
            remedy = "give a finite number, or leave the attribute out for MuJoCo's default"
            _fail(file, element, key, f'"{word}" is not a finite number up to {MAGNITUDE:g}', remedy)


def _copies(element: ElementTree.Element) -> int:
    if element.tag not in ("replicate", "composite", "flexcomp"):
        return 1
    return math.prod(max(1, count) for count in _counts(element, "count"))


def _refuse_sizes(file: Path, element: ElementTree.Element) -> None:
    for keys, tag, most in (
        (("width", "height"), "texture", MOST_ENTRIES), (("nrow", "ncol"), "hfield", MOST_ENTRIES),
        *(((key,), "size", MOST_RESERVED) for key in element.attrib if key.startswith(("nuser_", "nkey"))),
    ):  # fmt: skip
        if element.tag == tag:
            size = math.prod(max(1, count) for key in keys for count in _counts(element, key))
            if size > most:
                _fail(file, element, keys[0], f"it requests {size} entries, and the limit is {most}", "reduce it")


def _counts(element: ElementTree.Element, key: str) -> list[int]:
    """Integers of an attribute; an empty list if it is invalid, which MuJoCo reports."""
    try:
        return [int(float(word)) for word in element.get(key, "").split()]
    except (ValueError, OverflowError):
        return []


def _is_too_large(word: str) -> bool:
    """Whether the square of a number overflows: MuJoCo turns quaternions with such components into zeros."""
    try:
        return not usable(float(word))
    except ValueError:
        return False


def _fail(file: Path, element: ElementTree.Element, key: str, what: str, remedy: str) -> NoReturn:
    name = element.get("name")
    place = f'{element.tag} "{name}"' if name else element.tag
    raise ModelError(f"{file}: {place}, {key}: {what}: {remedy}")
