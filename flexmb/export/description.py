"""A model as `modelDescription.xml` of FMI 2.0 and 3.0."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Literal, assert_never
from xml.sax.saxutils import quoteattr

from flexmb.export.model import ExportedModel
from flexmb.output.versions import version_of

Version = Literal["2", "3"]
"""Of FMI: 2.0 or 3.0."""
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


def description(model: ExportedModel, version: Version, guid: str, step: float, code: str) -> str:
    """The text of the file; step (s): of Co-Simulation, 0 for none; code: digest of the library's sources."""
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + "\n".join(_lines(model, version, guid, step, code)) + "\n"


def _lines(model: ExportedModel, version: Version, guid: str, step: float, code: str) -> Iterator[str]:
    variables = list(_variables(model, version, step))
    yield from _head(model, version, guid, step)
    yield "<UnitDefinitions>"
    for unit in sorted({each.unit for each in variables}):
        powers = "".join(f' {base}="{power}"' for base, power in exponents(unit).items())
        yield f"<Unit name={quoteattr(unit)}><BaseUnit{powers}/></Unit>"
    yield "</UnitDefinitions>"
    yield '<LogCategories><Category name="logStatusError"/></LogCategories>'
    yield _experiment(model, step)
    digests = f'<digests scene="{model.digest}" model="{model.digest_of_model}" code="{code}"/>'
    if version == "2":
        yield f'<VendorAnnotations><Tool name="flexmb">{digests}</Tool></VendorAnnotations>'
    yield "<ModelVariables>"
    for each in variables:
        yield each.text(version)
    yield "</ModelVariables>"
    yield "<ModelStructure>"
    yield from _structure(variables, version)
    yield "</ModelStructure>"
    if version == "3":
        yield f'<Annotations><Annotation type="org.flexmb">{digests}</Annotation></Annotations>'
    yield "</fmiModelDescription>"


def _head(model: ExportedModel, version: Version, guid: str, step: float) -> Iterator[str]:
    """The first element, and what the model can do in both ways of use."""
    about = quoteattr(model.description or f"Multibody scene {model.name}, equations of motion by an O(N) recursion")
    common = (
        f'modelName={quoteattr(model.name)} description={about} license="{LICENSE}" '
        f'generationTool="flexmb {version_of("flexmb")}" variableNamingConvention="flat"'
    )
    has_derivatives, drifts = str(model.tangent is not None).lower(), bool(model.branch)
    match version:
        case "2":
            yield f'<fmiModelDescription fmiVersion="2.0" guid="{guid}" numberOfEventIndicators="0" {common}>'
            can = (
                f'modelIdentifier="{model.identifier}" canGetAndSetFMUstate="true" canSerializeFMUstate="true" '
                f'providesDirectionalDerivative="{has_derivatives}"'
            )
            steps = f'completedIntegratorStepNotNeeded="{str(not drifts).lower()}"'
        case "3":
            yield f'<fmiModelDescription fmiVersion="3.0" instantiationToken="{guid}" {common}>'
            can = (
                f'modelIdentifier="{model.identifier}" canGetAndSetFMUState="true" canSerializeFMUState="true" '
                f'providesDirectionalDerivatives="{has_derivatives}"'
            )
            steps = f'needsCompletedIntegratorStep="{str(drifts).lower()}"'
        case _:
            assert_never(version)
    yield f"<ModelExchange {can} {steps}/>"
    if step:
        more = ' canInterpolateInputs="false"' if version == "2" else ""
        yield f'<CoSimulation {can} canHandleVariableCommunicationStepSize="true"{more}/>'


def _structure(variables: Sequence[_Line], version: Version) -> Iterator[str]:
    """Outputs, rates, and what follows from start values. All depend on all states and inputs, as by default."""
    chosen = {
        "Output": [each for each in variables if each.causality == "output"],
        "ContinuousStateDerivative": [each for each in variables if each.is_rate],
        "InitialUnknown": [each for each in variables if each.is_computed],
    }
    if version == "3":
        yield from (f'<{kind} valueReference="{each.number}"/>' for kind, those in chosen.items() for each in those)
        return
    place = {each.number: i for i, each in enumerate(variables, 1)}
    for name, those in zip(("Outputs", "Derivatives", "InitialUnknowns"), chosen.values(), strict=True):
        listed = "".join(f'<Unknown index="{place[each.number]}"/>' for each in those)
        yield f"<{name}>{listed}</{name}>"


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
    """A variable: its text, and what the structure of the model says of it. words: causality, variability and
    description. rate_of: number of its state."""

    def __init__(
        self, name: str, number: int, words: tuple[str, str, str], unit: str, start: float | None = None,
        rate_of: int | None = None,
    ) -> None:  # fmt: skip
        causality, variability, about = words
        self.unit, self.causality, self.number, self.is_rate = unit, causality, number, rate_of is not None
        self.is_computed = start is None and causality != "independent"
        is_exact = "" if causality in ("input", "independent") else "calculated" if self.is_computed else "exact"
        self._about = (
            f'name={quoteattr(name)} valueReference="{number}" description={quoteattr(about)} causality="{causality}" '
            f'variability="{variability}"' + (is_exact and f' initial="{is_exact}"')
        )
        self._start = "" if start is None else f' start="{start!r}"'
        self._rate_of = rate_of

    def text(self, version: Version) -> str:
        """The element. FMI 2.0 names the state of a rate by its place, from 1, FMI 3.0 by its value reference."""
        first = 1 if version == "2" else 0
        of = "" if self._rate_of is None else f' derivative="{self._rate_of + first}"'
        values = f"unit={quoteattr(self.unit)}{self._start}{of}"
        match version:
            case "2":
                return f"<ScalarVariable {self._about}><Real {values}/></ScalarVariable>"
            case "3":
                return f"<Float64 {self._about} {values}/>"
            case _:
                assert_never(version)


def _variables(model: ExportedModel, version: Version, step: float) -> Iterator[_Line]:
    """All variables in the order of their value references: states, rates, inputs and parameters, outputs, the step;
    in FMI 3.0 also time."""
    count, number = len(model.states), 0
    for i, state in enumerate(model.states):
        what = "coordinate" if i < model.coordinates else "speed" if i < count - 1 else "work done on the system"
        yield _Line(state.name, number, ("output", "continuous", what), state.unit, state.start)
        number += 1
    for i, state in enumerate(model.states):
        unit = per_second(state.unit)
        yield _Line(f"der({state.name})", number, ("local", "continuous", "its rate"), unit, rate_of=i)
        number += 1
    for each in model.numbers.changeable:
        candidate = each.candidate
        if candidate.is_input:
            words = "input", "continuous", "load, motor or actuator"
        else:
            words = "parameter", "fixed" if candidate.is_prescribed else "tunable", f"{candidate.path} of the scene"
        name = f"{'inputs' if candidate.is_input else 'parameters'}.{candidate.name}"
        yield _Line(name, number, words, candidate.unit or "1", each.value)
        number += 1
    for output in model.outputs:
        about = "World axes" if "." in output.name else ""
        yield _Line(output.name, number, ("output", "continuous", about), output.unit)
        number += 1
    if step:
        yield _Line("step", number, ("parameter", "fixed", "largest step of Co-Simulation"), "s", step)
    if version == "3":
        yield _Line("time", number + 1, ("independent", "continuous", ""), "s")


def per_second(unit: str) -> str:
    """The unit of a rate."""
    known = {"m": "m/s", "rad": "rad/s", "1": "1/s", "m/s": "m/s²", "rad/s": "rad/s²", "1/s": "1/s²", "J": "W"}
    return known[unit]
