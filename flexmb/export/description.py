"""A model as `modelDescription.xml` of FMI 2.0."""

from __future__ import annotations

import re
from collections.abc import Iterator
from xml.sax.saxutils import quoteattr

from flexmb.export.model import ExportedModel
from flexmb.output.versions import version_of

BASE = {
    "1": {}, "m": {"m": 1}, "s": {"s": 1}, "kg": {"kg": 1}, "rad": {"rad": 1}, "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2}, "W": {"kg": 1, "m": 2, "s": -3},
}  # fmt: skip
"""Exponents of the base units of FMI."""
POWERS = str.maketrans({"²": "2", "³": "3", "^": None})
LICENSE = "the code of flexmb in the library: Apache-2.0; the model: as its author says"


def exponents(unit: str) -> dict[str, int]:
    """Exponents of base units of a unit such as "N m/rad" or "m/s²"; KeyError for a unit that is not known."""
    found = dict[str, int]()
    for place, part in enumerate(unit.translate(POWERS).split("/")):
        for word in part.split():
            symbol, power = re.fullmatch(r"(\D+|1)(\d*)", word).groups()  # type: ignore[union-attr]
            for base, exponent in BASE[symbol].items():
                found[base] = found.get(base, 0) + exponent * int(power or 1) * (-1 if place else 1)
    return {base: exponent for base, exponent in found.items() if exponent}


def description(model: ExportedModel, guid: str, step: float, code: str) -> str:
    """The text of the file; step (s): of Co-Simulation, 0 for none; code: digest of the library's sources."""
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + "\n".join(_lines(model, guid, step, code)) + "\n"


def _lines(model: ExportedModel, guid: str, step: float, code: str) -> Iterator[str]:
    about = quoteattr(model.description or f"Multibody scene {model.name}, equations of motion by an O(N) recursion")
    yield (
        f'<fmiModelDescription fmiVersion="2.0" modelName={quoteattr(model.name)} guid="{guid}" description={about} '
        f'license="{LICENSE}" generationTool="flexmb {version_of("flexmb")}" variableNamingConvention="flat" '
        'numberOfEventIndicators="0">'
    )
    can = (
        f'modelIdentifier="{model.identifier}" canGetAndSetFMUstate="true" canSerializeFMUstate="true" '
        f'providesDirectionalDerivative="{str(model.tangent is not None).lower()}"'
    )
    yield f'<ModelExchange {can} completedIntegratorStepNotNeeded="{str(not model.branch).lower()}"/>'
    if step:
        yield f'<CoSimulation {can} canHandleVariableCommunicationStepSize="true" canInterpolateInputs="false"/>'
    variables = list(_variables(model, step))
    yield "<UnitDefinitions>"
    for unit in sorted({each.unit for each in variables}):
        powers = "".join(f' {base}="{power}"' for base, power in exponents(unit).items())
        yield f"<Unit name={quoteattr(unit)}><BaseUnit{powers}/></Unit>"
    yield "</UnitDefinitions>"
    yield '<LogCategories><Category name="logStatusError"/></LogCategories>'
    yield _experiment(model, step)
    yield '<VendorAnnotations><Tool name="flexmb">'
    digests = f'scene="{model.digest}" model="{model.digest_of_model}" code="{code}"'
    yield f"<digests {digests}/></Tool></VendorAnnotations>"
    yield "<ModelVariables>"
    for each in variables:
        yield each.text
    yield "</ModelVariables>"
    yield "<ModelStructure>"
    for name, chosen in (
        ("Outputs", [i for i, each in enumerate(variables, 1) if each.causality == "output"]),
        ("Derivatives", [i for i, each in enumerate(variables, 1) if each.is_rate]),
        ("InitialUnknowns", [i for i, each in enumerate(variables, 1) if each.is_computed]),
    ):  # fmt: skip
        yield f"<{name}>" + "".join(f'<Unknown index="{i}"/>' for i in chosen) + f"</{name}>"
    yield "</ModelStructure>"
    yield "</fmiModelDescription>"


def _experiment(model: ExportedModel, step: float) -> str:
    """Where tables of functions of time are defined, so that tools begin and end there."""
    timing, ends = model.timing, ""
    if timing.start > 0.0:
        ends += f' startTime="{timing.start!r}"'
    if timing.end < float("inf"):
        ends += f' stopTime="{timing.end!r}"'
    if step:
        ends += f' stepSize="{100.0 * step!r}"'
    return f'<DefaultExperiment{ends} tolerance="1e-8"/>'


class _Line:
    """A variable: its text, and what the structure of the model says of it."""

    def __init__(
        self, name: str, number: int, causality: str, variability: str, about: str, unit: str, **real: str
    ) -> None:
        self.unit, self.causality, self.is_rate = unit, causality, "derivative" in real
        self.is_computed = "start" not in real
        initial = "" if causality == "input" else f' initial="{"calculated" if self.is_computed else "exact"}"'
        inner = "".join(f" {key}={quoteattr(value)}" for key, value in real.items())
        self.text = (
            f'<ScalarVariable name={quoteattr(name)} valueReference="{number}" description={quoteattr(about)} '
            f'causality="{causality}" variability="{variability}"{initial}><Real unit={quoteattr(unit)}{inner}/>'
            "</ScalarVariable>"
        )


def _variables(model: ExportedModel, step: float) -> Iterator[_Line]:
    """All variables in the order of their value references: states, rates, inputs and parameters, outputs."""
    count, number = len(model.states), 0
    for i, state in enumerate(model.states):
        what = "coordinate" if i < model.coordinates else "speed" if i < count - 1 else "work done on the system"
        yield _Line(state.name, number, "output", "continuous", what, state.unit, start=repr(state.start))
        number += 1
    for i, state in enumerate(model.states):
        unit = per_second(state.unit)
        yield _Line(f"der({state.name})", number, "local", "continuous", "its rate", unit, derivative=str(i + 1))
        number += 1
    for each in model.numbers.changeable:
        candidate = each.candidate
        if candidate.is_input:
            words = "input", "continuous", "load, motor or actuator"
        else:
            words = "parameter", "fixed" if candidate.is_prescribed else "tunable", f"{candidate.path} of the scene"
        name = f"{'inputs' if candidate.is_input else 'parameters'}.{candidate.name}"
        yield _Line(name, number, *words, candidate.unit or "1", start=repr(each.value))
        number += 1
    for output in model.outputs:
        yield _Line(
            output.name, number, "output", "continuous", "World axes" if "." in output.name else "", output.unit
        )
        number += 1
    if step:
        yield _Line("step", number, "parameter", "fixed", "largest step of Co-Simulation", "s", start=repr(step))


def per_second(unit: str) -> str:
    """The unit of a rate."""
    known = {"m": "m/s", "rad": "rad/s", "1": "1/s", "m/s": "m/s²", "rad/s": "rad/s²", "1/s": "1/s²", "J": "W"}
    return known[unit]
