"""Mutants of files: bytes cut, doubled and flipped; lines, numbers, strings and keys exchanged; names that are markup.

A mutant is made from a file and a random generator alone, so that its number and the campaign's seed bring it back.
"""

import hashlib
import io
import json
import re
import zipfile
import zlib
from base64 import b64encode
from collections.abc import Callable
from functools import cache
from random import Random
from typing import Any

import numpy as np

NASTY = (
    "[red]", "[/]", "[/red] x", "</script><script>alert(1)</script>", "<!--", "]]>", "a|b", "`", "a,b", "../../x",
    "'\"", "${HOME}", "\u2028", "\u202e", "", " ", "x" * 5000, "\\", "%s{0}", "marker:*", "é\u0301", "nan", "a.b:c",
    "=1+1", "@SUM(A1)", "'=x",
)  # fmt: skip
NUMBERS = (
    "nan", "inf", "-inf", "-1", "0", "-0.0", "1e308", "-1e308", "1e-320", "1e999", "9" * 400, "9" * 5000, "true", '"1"',
    "1e15", "1000000000000000", "100000",
    "[]", "{}", "0x" + "f" * 300, "1_0", "1,5", "2020-01-01", "null", "''", "1j",
)  # fmt: skip
NUMBER = re.compile(rb"(?<![\w.])[-+]?\d+(\.\d+)?([eE][-+]?\d+)?")
STRING = re.compile(rb'"[^"\n]*"')
KEY = re.compile(rb"(?m)^(\w+)(?= = )|(?<=[{,] )(\w+)(?= = )")

Mutation = Callable[[Random, bytes], bytes]


def _span(random: Random, data: bytes) -> tuple[int, int]:
    start = random.randrange(len(data) + 1)
    return start, min(len(data), start + random.choice((1, 2, 8, 64, 1024)))


def cut(random: Random, data: bytes) -> bytes:
    start, end = _span(random, data)
    return data[:start] + data[end:]


def double(random: Random, data: bytes) -> bytes:
    start, end = _span(random, data)
    return data[:end] + data[start:end] * random.choice((1, 1, 100)) + data[end:]


def flip(random: Random, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(random.choice((1, 1, 4, 32))):
        if changed:
            changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
    return bytes(changed)


def insert(random: Random, data: bytes) -> bytes:
    at = random.randrange(len(data) + 1)
    what = (b"\0", b"\xff", b"\xef\xbb\xbf", b"\n", b"\r", b'"', b"[", b"\xc0\x80", b"," * 2000, b"\n" * 2000)
    return data[:at] + random.choice(what) + data[at:]


def truncate(random: Random, data: bytes) -> bytes:
    return data[: random.randrange(len(data) + 1)]


def dress(random: Random, data: bytes) -> bytes:
    """Byte order marks, other line ends and encodings, nothing at all."""
    text = data.decode("utf-8", "replace")
    return random.choice(
        (b"\xef\xbb\xbf" + data, data.replace(b"\n", b"\r\n"), data.replace(b"\n", b"\r"), text.encode("utf-16"),
         text.encode("latin-1", "replace"), b"", b"\n", data.rstrip(b"\n"), data + b"\0" * 100)
    )  # fmt: skip


def lines(random: Random, data: bytes) -> bytes:
    """A line dropped, doubled, swapped with another, or moved."""
    rows = data.splitlines(keepends=True)
    if len(rows) < 2:
        return data
    i, j = random.randrange(len(rows)), random.randrange(len(rows))
    match random.randrange(4):
        case 0:
            del rows[i]
        case 1:
            rows.insert(j, rows[i])
        case 2:
            rows[i], rows[j] = rows[j], rows[i]
        case _:
            rows.insert(j, rows.pop(i))
    return b"".join(rows)


def _replace(random: Random, data: bytes, pattern: re.Pattern[bytes], new: Callable[[bytes], bytes]) -> bytes:
    found = list(pattern.finditer(data))
    if not found:
        return data
    match = random.choice(found)
    return data[: match.start()] + new(match[0]) + data[match.end() :]


def number(random: Random, data: bytes) -> bytes:
    return _replace(random, data, NUMBER, lambda old: random.choice((*NUMBERS, "-" + old.decode())).encode())


def string(random: Random, data: bytes) -> bytes:
    """A string becomes another of the file, a nasty one, or something that is none."""
    others = STRING.findall(data) or [b'""']
    nasty = json.dumps(random.choice(NASTY)).encode()
    return _replace(random, data, STRING, lambda old: random.choice((nasty, random.choice(others), b"1", b"[]", b"{}")))


def key(random: Random, data: bytes) -> bytes:
    """A key of TOML renamed, doubled, or joined by one that nobody knows."""

    def new(old: bytes) -> bytes:
        unknown, doubled = b"surprise = 1\n" + old, old + b" = 1\n" + old
        return random.choice((old + b"x", b'"' + old + b' "', unknown, doubled, b"a.b." + old))

    return _replace(random, data, KEY, new)


def nest(random: Random, data: bytes) -> bytes:
    """Something nested far too deeply."""
    depth = random.choice((50, 500, 5000, 100_000))
    deep = random.choice((b"[" * depth + b"]" * depth, b"{a = " * depth + b"1" + b"}" * depth, b"[" * depth,
                          b'{"a":' * depth + b"1" + b"}" * depth))  # fmt: skip
    return _replace(random, data, NUMBER, lambda old: deep)


BYTES: tuple[Mutation, ...] = (cut, double, flip, insert, truncate, dress)
TEXT: tuple[Mutation, ...] = (*BYTES, lines, number, number, string, string, nest)
TOML: tuple[Mutation, ...] = (*TEXT, key, key)


def cells(random: Random, data: bytes) -> bytes:
    """Cells, columns and rows of a CSV: exchanged, emptied, quoted, separated and written otherwise."""
    rows = [line.split(b",") for line in data.splitlines()]
    i, j = random.randrange(len(rows)), random.randrange(len(rows[0]))
    words = (b"", b" ", b"nan", b"inf", b"-inf", b"1e999", b"1,5", b'"1', b'"1,5"', b"1;5", b"abc", b"1_000", b"0x10",
             b"x" * 200_000, b"1e308", "\u0661".encode(), b"t", *(name.encode() for name in NASTY))  # fmt: skip
    match random.randrange(9):
        case 0 | 1 | 2:
            rows[i][min(j, len(rows[i]) - 1)] = random.choice(words)
        case 3:
            rows[0][j] = random.choice((*rows[0], *words))
        case 4:
            rows = [row[:j] + row[j + 1 :] for row in rows]
        case 5:
            rows = [[*row, row[min(j, len(row) - 1)]] for row in rows]
        case 6:
            rows[i] = rows[i] + [b"1"] * random.choice((1, 100_000)) if random.random() < 0.5 else rows[i][:j]
        case 7:
            return b"\n".join(b";".join(row) for row in rows).replace(b".", b",")
        case _:
            rows = [[*row, b"0"] for row in rows]
            rows[0][-1] = random.choice(words)
    return b"\n".join(b",".join(row) for row in rows) + b"\n"


def fields(random: Random, data: bytes) -> bytes:
    """A value somewhere in one line of JSON: of another type, out of range, missing, or beside one that is unknown."""
    rows = data.splitlines()
    i = random.randrange(len(rows))
    try:
        content = json.loads(rows[i])
    except ValueError:
        return data
    spots: list[tuple[Any, Any]] = []

    def walk(value: Any) -> None:
        for step in value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
            spots.append((value, step))
            walk(value[step])

    walk(content)
    inside, step = random.choice(spots)
    old = inside[step]
    less = -old if isinstance(old, int | float) else old[: len(old) // 2] if isinstance(old, str) else old
    values = (None, True, "", "x", 1, -1, 0, 1.5, 1e308, 10**30, [], {}, [old], {"a": old}, random.choice(NASTY), less)
    match random.randrange(5):
        case 0 if isinstance(inside, dict):
            inside["surprise"] = random.choice(values)
        case 1 if isinstance(inside, dict):
            inside[random.choice(NASTY)] = inside.pop(step)
        case 2:
            del inside[step]
        case _:
            inside[step] = random.choice(values)
    rows[i] = json.dumps(content).encode()
    return b"\n".join(rows) + b"\n"


TAG = re.compile(rb"<(?![!?/])[^<>]*>")
ATTRIBUTE = re.compile(rb' ([\w:]+)="([^"]*)"')
WORDS = (
    "nan", "NaN", "-nan", "nan(1)", "inf", "-Infinity", "1e999", "", "0", "-1", "1e308", "1e-320", "1 2", "x", "0x1p3",
    "1_0", "\u0661", "99999999", "&#110;an", "&lt;", "true", "1,5", " 1 ",
)  # fmt: skip


def attributes(random: Random, data: bytes) -> bytes:
    """An attribute of XML dropped, doubled, renamed, or one of its words exchanged for what is no number."""

    def new(old: bytes) -> bytes:
        name, _, words = old.strip().partition(b'="')
        listed = words[:-1].split() or [b""]
        if random.random() < 0.7:
            listed[random.randrange(len(listed))] = random.choice(WORDS).encode()
        else:
            listed = random.choice(([], listed[:-1], [*listed, b"1"], listed[::-1]))
        exchanged = b" " + name + b'="' + b" ".join(listed) + b'"'
        return random.choice((b"", old + old, old.replace(name, name + b"x"), *[exchanged] * 6))

    return _replace(random, data, ATTRIBUTE, new)


def elements(random: Random, data: bytes) -> bytes:
    """A tag of XML dropped, doubled, renamed, moved, or repeated by MuJoCo's own means."""
    found = list(TAG.finditer(data))
    if not found:
        return data
    other = random.choice(found)[0]
    count = random.choice((b"3", b"100000", b"99999999999", b"-1", b"nan"))
    return _replace(random, data, TAG, lambda old: random.choice((
        b"", old + old, old + other, other, old.replace(b"<", b"<x", 1), b"<!-- -- " + old + b" -->" + old,
        b'<replicate count="' + count + b'">' + old + b"</replicate>", b'<include file="' + count + b'.xml"/>' + old,
    )))  # fmt: skip


def seal_anew(random: Random, data: bytes) -> bytes:
    """What results.json says changed, and sealed again by who knows how: only what it says can be refused then."""
    content = json.loads(fields(random, data))
    content.pop("sha256", None)
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    content["sha256"] = hashlib.sha256(text.encode()).hexdigest()
    return json.dumps(content, sort_keys=True, separators=(",", ":")).encode() + b"\n"


def arrays_of_records(random: Random, data: bytes) -> bytes:
    """Signals of one record: other shapes, other sizes, damaged text, and bombs."""
    rows = data.splitlines()
    i = random.randrange(len(rows))
    content = json.loads(rows[i])
    packed = [content["times"], *content["channels"].values()] if content.get("times") else []
    if not packed:
        return data
    one = random.choice(packed)
    match random.randrange(6):
        case 0:
            one["shape"] = random.choice(([], [0], [-1], [-1, -1], [10**9, 3], [10**30], [3, 27], [1] * 40, [2**62, 4]))
        case 1:
            one["data"] = one["data"][: random.randrange(len(one["data"]))]
        case 2:
            one["data"] = b64encode(zlib.compress(bytes(random.choice((0, 7, 8, 10**6))))).decode()
        case 3:
            count = random.choice((10**6, 8 * 10**7))
            one["shape"], one["data"] = [count], zeros(count)
        case 4:
            one["data"] = random.choice(("", "!", "é", "AAAA", "=" * 100, one["data"] * 2))
        case _:
            other = random.choice(packed)
            one["shape"], one["data"] = other["shape"], other["data"]
    rows[i] = json.dumps(content).encode()
    return b"\n".join(rows) + b"\n"


@cache
def zeros(count: int) -> str:
    """So many zeros, packed as a record packs them."""
    return b64encode(zlib.compress(bytes(8 * count), 1)).decode()


LARGE = 10**8
TYPES = (complex, np.float16, np.float32, np.longdouble, np.int32, bool, "S8", "U4", object, "M8[s]", ">f8")


class _Callee:
    """What unpickling must never reach."""

    def __reduce__(self) -> Any:
        return exec, ("raise SystemExit('unpickled')",)


def members(random: Random, data: bytes) -> bytes:
    """Arrays of an .npz: other types, shapes and names, members that are none, and bombs."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        if sum(member.file_size for member in archive.infolist()) > LARGE:  # a bomb already: another would take minutes
            return data
    with np.load(io.BytesIO(data)) as archive:
        given: dict[str, Any] = dict(archive)
    name = random.choice(list(given))
    old = given[name]
    extra: list[tuple[str, bytes]] = []
    match random.randrange(12):
        case 0:
            given[name] = old.astype(random.choice(TYPES))
        case 1:
            given[name] = old + 1j
        case 2:
            given[name] = np.array([_Callee()], dtype=object)
        case 3:
            given[name] = old.reshape(-1) if random.random() < 0.5 else old[..., None]
        case 4:
            del given[name]
        case 5:
            given[random.choice((*NASTY[:10], name + "s"))] = old
        case 6:
            flat = old.astype(float)
            flat.flat[random.randrange(old.size)] = random.choice((np.nan, np.inf, -np.inf, -1.0, 1e308, 0.0))
            given[name] = flat
        case 7:
            given[name] = np.zeros((2 * 10**7, 3) if random.random() < 0.1 else (1000, 3, 4))
        case 8:
            extra.append((name + ".npy", _npy(old)))
        case 9:
            extra.append((random.choice(("note.txt", "../x.npy", "a/b.npy", "x")), b"hello"))
        case 10:
            extra.append(("huge.npy", _header("(9999999999999, 3)")))
            del given[name]
            extra.append((name + ".npy", _header(random.choice(("(-1,)", "(10**9,)", "(99999999999,)", "'a'", "()" )))))
        case _:
            given[name] = np.asfortranarray(old)[..., ::-1]
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for key_, value in given.items():
            archive.writestr(f"{key_}.npy", _npy(value))
        for key_, raw in extra:
            archive.writestr(key_, raw)
    return stream.getvalue()


def _npy(values: Any) -> bytes:
    stream = io.BytesIO()
    np.save(stream, values, allow_pickle=True)
    return stream.getvalue()


def _header(shape: str) -> bytes:
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
    text += b" " * (-(len(text) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


def mutant(random: Random, data: bytes, mutations: tuple[Mutation, ...]) -> tuple[str, bytes]:
    """One to three mutations, one after the other: what was done, and the result."""
    done = []
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        mutation = random.choice(mutations)
        try:
            data = mutation(random, data)
        except Exception:  # what came before left nothing that this mutation understands
            continue
        done.append(mutation.__name__)
    return "+".join(done), data
