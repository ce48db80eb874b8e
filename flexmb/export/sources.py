"""A model as C: what is the same for all models, in `c/`, with the names and tables of this one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib.resources import files
from math import inf

import numpy as np

from flexmb.export.description import Version
from flexmb.export.model import ADVICE, OUT, C, ExportedModel, W
from flexmb.jit.duals import DUAL
from flexmb.linear.closed_loop import LARGE
from flexmb.tables.status import Status

PER_LINE = 8


def header(model: ExportedModel) -> str:
    """The header: sizes and functions."""
    numbers = model.numbers.changeable
    sizes = {
        "STATES": len(model.states), "COORDINATES": model.coordinates, "OUTPUTS": len(model.outputs),
        "INPUTS": sum(each.candidate.is_input for each in numbers), "NUMBERS": len(numbers),
        "BYTES": 8 * len(model.image.words), "REMEMBERED": sum(size for _, size in model.branch.values()),
        "DERIVATIVES": int(model.tangent is not None),
    }  # fmt: skip
    text = _shared("core.h", model)
    for name, size in sizes.items():
        text = text.replace(f"@{name}@", str(size))
    return text


def core(model: ExportedModel) -> str:
    """Tables and functions, in one file that includes the header."""
    return "\n".join([*_tables(model), _shared("core.c", model)])


def instance(model: ExportedModel) -> str:
    """What the versions of FMI have in common, which `interface` includes."""
    return _shared("instance.c", model)


def interface(model: ExportedModel, version: Version, guid: str, step: float) -> str:
    """The functions of FMI, to be appended to `core`; step (s): of Co-Simulation, 0 for none."""
    name = model.identifier
    return f'#define {name}_GUID "{guid}"\n#define STEP {_real(step)}\n' + _shared(f"fmi{version}.c", model)


def example(model: ExportedModel) -> str:
    """A program that runs the model."""
    return _shared("main.c", model)


def browser(model: ExportedModel) -> str:
    """The functions of a page of the web, to be appended to `core`."""
    return _shared("page.c", model)


def _shared(file: str, model: ExportedModel) -> str:
    text = files("flexmb.export").joinpath("c", file).read_text(encoding="utf-8")
    return text.replace("MODEL", model.identifier)


def _tables(model: ExportedModel) -> Iterable[str]:
    name, block, numbers = model.identifier, model.image, model.numbers.changeable
    yield f'#include "{name}.h"\n#include <math.h>\n#include <stdint.h>\n#include <stdio.h>\n#include <string.h>\n'
    yield _array("uint64_t", "IMAGE", (f"0x{word:x}u" for word in block.words[: block.stored].view(np.uint64).tolist()))
    yield _array("uint32_t", "ADDRESSES", (f"{{{word}u, {to}u}}" for word, to in block.addresses.tolist()), "[2]")
    for constant, value in (
        ("CONSTANTS", block.bundles[C]), ("WORKSPACE", block.bundles[W]), ("OUTPUTS", block.bundles[OUT]),
        ("ENERGY", model.outputs_at("energy.kinetic")), ("FAULT", model.fault),
        ("BEFORE", model.branch["time"][0] if model.branch else 0), ("SWITCHES", len(model.timing.switches)),
        ("SINGULAR", int(Status.CLOSURE_SINGULAR)), ("BRANCH", int(Status.BRANCH_UNKNOWN)),
        ("NONFINITE", int(Status.NONFINITE)),
        ("FROM", _real(model.timing.start)), ("UNTIL", _real(model.timing.end)),
    ):  # fmt: skip
        yield f"#define {constant} {value}"
    if tangent := model.tangent:
        for constant, value in (
            ("TANGENT", tangent.tables), ("DIFFERENTIATED", tangent.constants), ("JACOBIAN", tangent.jacobian),
            ("DIRECTION", tangent.direction),
            ("ENERGY_OUTPUT", [output.name for output in model.outputs].index("energy.kinetic")),
            ("DUAL", DUAL.width), ("LARGE", _real(LARGE)),
            ("INPUT_WORDS", sum(len(each.effects) for each in numbers if each.candidate.is_input)),
        ):  # fmt: skip
            yield f"#define {constant} {value}"
        yield _array("int", "CHANGE", map(str, tangent.places))
    yield _array("double", "SWITCH", map(_real, model.timing.switches or (inf,)))
    yield _array("int", "PLACE", (str(output.word) for output in model.outputs))
    words = sorted({effect.word for each in numbers for effect in each.effects})
    at = {word: i for i, word in enumerate(words)}
    of_word: list[list[tuple[int, float]]] = [[] for _ in words]
    for i, each in enumerate(numbers):
        for word, slope in each.effects:
            of_word[at[word]].append((i, slope))
    rest = [
        float(block.words[word]) - sum(slope * numbers[i].value for i, slope in effects)
        for word, effects in zip(words, of_word, strict=True)
    ]
    small = [4.0 * 2.0**-52 * abs(float(block.words[word])) for word in words]
    rest = [0.0 if abs(value) <= size else value for value, size in zip(rest, small, strict=True)]
    yield _array("int", "WORDS", map(str, words or (0,)))
    yield _array("double", "REST", map(_real, rest or (0.0,)))
    yield _array("int", "EFFECTS", map(str, _starts(list(map(len, of_word)))))
    yield _array("int", "OF_NUMBER", [str(i) for effects in of_word for i, _ in effects] or ["0"])
    yield _array("double", "SLOPE", [_real(slope) for effects in of_word for _, slope in effects] or ["0.0"])
    yield _array("int", "TOUCHES", map(str, _starts([len(each.effects) for each in numbers])))
    yield _array("int", "TOUCHED", [str(at[effect.word]) for each in numbers for effect in each.effects] or ["0"])
    ranges = (f"{{{first}u, {size}u}}" for first, size in model.branch.values() or ((0, 0),))
    yield _array("uint32_t", "KEPT", ranges, "[2]")
    named = {"BODY_NAMES": model.bodies, "CONNECTOR_NAMES": model.connectors, "CLOSURE_NAMES": model.closures}
    for array, those in named.items():
        yield _array("char *const", array, map(_text, those or ("",)))
    advice = (
        f"{{{status}, {_at_fault(status)}, {len(named[_at_fault(status)])}, "
        f"{_text(text.replace('%', '%%').replace('{body}', _QUOTED))}}}"
        for status, text in ADVICE.items()
    )
    fields = "int status; const char *const *names; int count; const char *text;"
    yield f"static const struct {{ {fields} }} ADVICE[] = {{" + ",\n".join(advice) + "};"
    changeable = [each.candidate.name for each in numbers]
    for what, names in (
        ("state", [each.name for each in model.states]), ("number", changeable or [""]),
        ("output", [each.name for each in model.outputs]),
    ):  # fmt: skip
        yield _array("char *const", f"{name}_{what}_names", map(_text, names), shared=True)
    yield _array("double", f"{name}_state_start", (_real(each.start) for each in model.states), shared=True)
    yield _array("double", f"{name}_number_start", [_real(each.value) for each in numbers] or ["0.0"], shared=True)


_QUOTED = '"%s"'


def _at_fault(status: int) -> str:
    """The array with the names of what a failure may be at."""
    match status:
        case Status.CONNECTOR_OVERTURNED:
            return "CONNECTOR_NAMES"
        case Status.CLOSURE_SINGULAR | Status.CLOSURE_OPEN | Status.BRANCH_UNKNOWN:
            return "CLOSURE_NAMES"
    return "BODY_NAMES"


def _starts(counts: Sequence[int]) -> list[int]:
    return [0, *np.cumsum(counts, dtype=int).tolist()]


def _array(kind: str, name: str, cells: Iterable[str], inner: str = "", shared: bool = False) -> str:
    listed = list(cells)
    lines = (", ".join(listed[i : i + PER_LINE]) for i in range(0, len(listed), PER_LINE))
    return f"{'' if shared else 'static '}const {kind} {name}[]{inner} = {{\n" + ",\n".join(lines) + "\n};"


def _real(value: float) -> str:
    """A number in C, exactly."""
    if value in (inf, -inf):
        return "INFINITY" if value > 0.0 else "(-INFINITY)"
    return value.hex()


def _text(text: str) -> str:
    """A string of C in UTF-8; what is not plain is escaped, so that no name of a scene can end the string."""
    plain = (chr(byte) if 32 <= byte < 127 and chr(byte) not in '"\\?' else f"\\{byte:03o}" for byte in text.encode())
    return '"' + "".join(plain) + '"'
