"""What the files of a case hold: anything else is refused, by file and place, before it is used.

A form is a type, a shape (a tuple) of nested lists of numbers, a list [form], an object {key: form} with these keys and
no others, {"*": form} one with any keys, or a function of data, place and lengths that raises ValueError. A letter in a
shape stands for a length that is the same in the whole file, None for any.
"""

import csv
import json
from io import StringIO
from math import isfinite
from os.path import isfile
from pathlib import Path

import numpy as np

CLOSE = 1e-9  # how far a rotation may be from an orthonormal matrix, and a direction from a unit vector


def read_json(file, form):
    """The content of a JSON file of this form; its numbers are all finite floats."""

    def once(pairs):
        if len(dict(pairs)) < len(pairs):
            raise ValueError("a key stands twice in one object")
        return dict(pairs)

    try:
        words = {"parse_int": _finite, "parse_float": _finite, "parse_constant": _finite}
        data = json.loads(_read(file), object_pairs_hook=once, **words)
        fit(data, form, "", {})
    except (ValueError, RecursionError) as error:
        raise SystemExit(f"{file}: {error}") from None
    return data


def read_table(file, texts=()):
    """The columns of a CSV file by their names: arrays of finite numbers, or texts where they are named so."""
    try:
        head, *rows = csv.reader(StringIO(_read(file), newline=""), strict=True)
        if not rows or any(len(row) != len(head) for row in rows) or len(set(head)) < len(head):
            raise ValueError("it is no table: names that differ, and below them rows as long as they are")
        columns = {name: [row[i] for row in rows] for i, name in enumerate(head)}
        return {name: cells if name in texts else np.array([*map(_finite, cells)]) for name, cells in columns.items()}
    except (ValueError, csv.Error) as error:
        raise SystemExit(f"{file}: {error}") from None


def _read(file):
    """The text of a file; pipes and devices, which may never end, are none."""
    if not isfile(file):
        raise SystemExit(f"{file}: there is no such file")
    return Path(file).read_bytes().decode()


def _finite(word):
    if not isfinite(value := float(word)):
        raise ValueError(f"{word:.40} is no finite number")
    return value


def fit(data, form, place, lengths):
    """ValueError names the place where data are not of the form; `lengths` has those that letters stand for."""
    if isinstance(form, type):
        _need(data, form, place)
    elif isinstance(form, tuple):
        _need(data, list if form else float, place)
        if form:
            first = lengths.setdefault(form[0], len(data)) if isinstance(form[0], str) else form[0]
            if first not in (None, len(data)):
                raise ValueError(f"{place} has {len(data)} items, which should be {first}")
            for i, item in enumerate(data):
                fit(item, form[1:], f"{place}[{i}]", lengths)
    elif isinstance(form, list):
        _need(data, list, place)
        for i, item in enumerate(data):
            fit(item, form[0], f"{place}[{i}]", lengths)
    elif isinstance(form, dict):
        _need(data, dict, place)
        wanted = dict.fromkeys(data, form["*"]) if "*" in form else form
        if wrong := sorted(data.keys() ^ wanted.keys()):
            raise ValueError(f"{place or 'the file'} lacks keys or has others: {', '.join(wrong):.200}")
        for key, inner in wanted.items():
            fit(data[key], inner, f"{place}.{key}".lstrip("."), lengths)
    else:
        form(data, place, lengths)


def _need(data, kind, place):
    if not isinstance(data, kind):
        names = {str: "text", float: "number", bool: "true or false", list: "list", dict: "object"}
        raise ValueError(f"{place or 'the file'} is no {names[kind]}")


# Functions as forms


def anything(data, place, lengths):
    """What this program does not look at."""


def nothing(data, place, lengths):
    """A part that this program cannot rebuild."""
    if data != []:
        raise ValueError(f"it has {place}, which this program does not rebuild")


def above(least):
    """A number of this size or more."""

    def form(data, place, lengths):
        fit(data, float, place, lengths)
        if data < least:
            raise ValueError(f"{place} is {data:g}, which is too small")

    return form


def unit(length):
    """A vector, or a quaternion, of length one."""

    def form(data, place, lengths):
        fit(data, (length,), place, lengths)
        if not abs(np.linalg.norm(data) - 1.0) < CLOSE:
            raise ValueError(f"{place} has not the length one")

    return form


def rotation(data, place, lengths):
    """A rotation matrix."""
    fit(data, (3, 3), place, lengths)
    R = np.array(data)
    if not np.max(np.abs(R @ R.T - np.eye(3))) < CLOSE or np.linalg.det(R) < 0.0:
        raise ValueError(f"{place} is no rotation")


def one_of(*words):
    """One of these texts."""

    def form(data, place, lengths):
        if data not in words:
            raise ValueError(f"{place} is none of {', '.join(words)}")

    return form


def modes(data, place, lengths):
    """The number of modes, after arrays that have so many."""
    if data != lengths["m"]:
        raise ValueError(f"{place} is {data!r:.40}, but arrays are of {lengths['m']} modes")


def maybe(form):
    """Null, or this."""
    return lambda data, place, lengths: None if data is None else fit(data, form, place, lengths)


def empty_or(form):
    """An empty object, or this."""
    return lambda data, place, lengths: None if data == {} else fit(data, form, place, lengths)


def by(key, forms):
    """An object, the rest of whose form is that of the text at a key."""

    def form(data, place, lengths):
        _need(data, dict, place)
        one_of(*forms)(data.get(key), f"{place}.{key}".lstrip("."), lengths)
        fit(data, {key: str} | forms[data[key]], place, lengths)

    return form


FRAME = {"position_m": (3,), "rotation": rotation}
FUNCTION = by("kind", {
    "constant": {"value": float},
    "ramp": {"value": float, "rate": float, "start_s": float},
    "sine": {"amplitude": float, "angular_frequency_rad_s": float, "phase_rad": float, "offset": float},
    "smooth_step": {"start_value": float, "end_value": float, "start_s": float, "duration_s": above(1e-300)},
    "spin_up": {"rate": float, "duration_s": above(1e-300)},
    "pulse": {"value": float, "start_s": float, "duration_s": above(0.0)},
    "table": {"times_s": (None,), "values": (None,)},
})  # fmt: skip
SCALAR = {
    "name": str, "axis": unit(3), "pitch_m_rad": float, "value": float, "rate": float, "stiffness": float,
    "damping": float, "rest": float, "effort": maybe(FUNCTION), "prescribed": maybe(FUNCTION),
}  # fmt: skip
TURNS = {"quaternion": unit(4), "angular_velocity_rad_s": (3,)}
FREEDOM = by("motion", dict.fromkeys(("turn", "slide", "screw"), SCALAR) | {
    "ball": TURNS | {"stiffness_Nm_rad": float, "damping_Nms_rad": float},
    "free": TURNS | {"position_m": (3,), "velocity_m_s": (3,)},
})  # fmt: skip
BODY = by("kind", {
    "modal": {"name": str, "file": str},
    "rigid": {
        "name": str, "mass_kg": above(0.0), "mass_centre_m": (3,), "inertia_kg_m2": (3, 3), "nodes": {"*": FRAME},
    },
})  # fmt: skip
MODEL = {
    **dict.fromkeys(("beams", "closures", "connectors", "controllers", "events"), nothing),
    "format": one_of("crosscheck export 1"), "name": str, "description": str, "gravity_m_s2": (3,),
    "sensors": [anything], "bodies": [BODY],
    "joints": [{
        "name": str, "kind": str, "parent": str, "parent_node": str, "parent_offset": FRAME,
        "child": str, "child_node": str, "child_offset": FRAME, "freedoms": [FREEDOM],
    }],
    "loads": [{
        "name": str, "type": one_of("force", "torque"), "body": str, "node": str, "direction": unit(3),
        "frame": one_of("world", "node"), "function": FUNCTION,
    }],
    "markers": [{"name": str, "body": str, "node": str, "offset_m": (3,)}],
    "modal_states": {"*": {"coordinates": (None,), "rates": (None,)}},
}  # fmt: skip
FIRST = dict.fromkeys(("translation_modes", "rotation_modes"), (3, "m"))
SECOND = dict.fromkeys(("second_translation", "second_rotation"), (3, "m", "m"))


def _node(data, place, lengths):
    """A frame with modes; one that does not move has no terms of second order."""
    moves = isinstance(data, dict) and SECOND.keys() & data.keys()
    fit(data, FRAME | FIRST | (SECOND if moves else {}), place, lengths)


def _modal(rows, node):
    """A flexible body, whose points have these rows of modes."""
    return {
        "clamped": bool, "stiffness": ("m", "m"), "damping": ("m", "m"),
        "points": {
            "mass_kg": ("n",), "position_m": ("n", 3), "mass_centre_offset_m": ("n", 3), "inertia_kg_m2": ("n", 3, 3),
            **{key: ("n", *shape) for key, shape in rows.items()},
        },
        "nodes": {"*": node},
        "integrals": empty_or({
            "mass": float, "s0": (3,), "s1": (3, "m"), "J0": (3, 3), "J1": ("m", 3, 3), "J2": ("m", "m", 3, 3),
            "C0": (3, "m"), "C1": ("m", 3, "m"), "M_ff": ("m", "m"), "spatial_mass": ("k", "k"),
        }),
        "modes": modes,
    }  # fmt: skip


MODAL = by("level", {"full": _modal(FIRST, FRAME | FIRST), "stiffened": _modal(FIRST | SECOND, _node)})
