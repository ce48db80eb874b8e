"""A scene as an exported model: equations as machine code, tables as a block, variables by name and unit."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from hashlib import sha256
from typing import Any, NamedTuple

import numpy as np

from flexmb.closure.tables import Closed
from flexmb.export import entry
from flexmb.export.emitted import LEVEL, emitted
from flexmb.export.image import ROW, Image, flattened, image, number_of
from flexmb.export.numbers import Numbers, numbers, with_inputs
from flexmb.export.refusals import refuse, refuse_derivatives
from flexmb.jit.duals import DUAL
from flexmb.jit.pointer import REAL, WHOLE
from flexmb.run.run_arrays import Kind, labels
from flexmb.run.times import Timing, timing_of
from flexmb.scene.connectors import AlongHinge
from flexmb.scene.files import dumps
from flexmb.scene.schema import Scene
from flexmb.scene.without_start import without_start
from flexmb.system.compile import assembled, compile
from flexmb.system.observables import ENERGIES
from flexmb.system.system import System
from flexmb.tables.arrays import Constants
from flexmb.tables.status import Status
from flexmb.tables.workspaces import workspace
from flexmb.typing import Real

C, W, OUT, TANGENT = range(4)
"""Numbers of the bundles in the block: constants, workspace, outputs; of chains the chain, `EndLoads`, outputs. With
derivatives there is a fourth one, for these."""
TOTAL = -1
"""Place of the output that is no word of the block: the sum of the energies."""


class Variable(NamedTuple):
    """A variable of the model: its name, unit and start value."""

    name: str
    unit: str
    start: float = 0.0


class Output(NamedTuple):
    """An output and its word in the block, or TOTAL."""

    name: str
    unit: str
    word: int


class Tangent(NamedTuple):
    """Where derivatives are in the block.

    tables, constants: offsets (bytes) of their bundle and of that which the kernels take before it. jacobian,
    direction: first words of J (n,n) and of the direction (n,). places: words of the derivatives of the outputs, or
    TOTAL.
    """

    tables: int
    constants: int
    jacobian: int
    direction: int
    places: tuple[int, ...]


class ExportedModel(NamedTuple):
    """What is exported.

    name: of the scene; identifier: as a name of C; digest: of the scene's text; digest_of_model: of that without
    initial values. states: q, u and work, the speeds after `coordinates` of them. numbers: inputs and parameters.
    bodies, connectors: names for messages. fault: word with the number of the body that a failure is at. code: object
    file with functions <identifier>_kernel_rates, _outputs and _settle, with derivatives also _derivatives and
    _outputs_along. closures: names of what closes a chain, none of a tree; branch: first word and length of the arrays
    that its motion is remembered in, by name. open_loads: why loads are no outputs, empty if they are. tangent: of
    derivatives, None if there are none.
    """

    name: str
    description: str
    identifier: str
    digest: str
    digest_of_model: str
    states: tuple[Variable, ...]
    coordinates: int
    numbers: Numbers
    outputs: tuple[Output, ...]
    image: Image
    timing: Timing
    bodies: tuple[str, ...]
    connectors: tuple[str, ...]
    fault: int
    closures: tuple[str, ...]
    branch: dict[str, tuple[int, int]]
    open_loads: str
    tangent: Tangent | None
    code: bytes

    def outputs_at(self, name: str) -> int:
        """The word of an output."""
        return next(output.word for output in self.outputs if output.name == name)


def model(scene: Scene, inputs: Sequence[str] = (), derivatives: bool = False, target: str = LEVEL) -> ExportedModel:
    """The model of a scene; inputs: paths of loads, motors and actuators that are inputs instead of what they are.

    Constant loads, motors and actuators are inputs, too. derivatives: with those of rates and outputs. target: one of
    `emitted.TARGETS`. NotExportable for what is not exported, before anything is compiled; SceneError for a scene that
    is wrong, PathError for an input that is not there, ValueError for another target.
    """
    prepared, kinds = tabled(scene, inputs, derivatives)
    return prepared._replace(code=machine_code(prepared.identifier, kinds, target))


def tabled(
    scene: Scene, inputs: Sequence[str] = (), derivatives: bool = False
) -> tuple[ExportedModel, tuple[Any, ...]]:
    """The model without its code, and the types of the tables that the code is compiled for."""
    refuse(scene)
    scene = with_inputs(scene, tuple(inputs))
    system = compile(scene, kernels="special")
    if derivatives:
        refuse_derivatives(system)
    apart = system.with_numbers(system.scene)  # equal functions of time are numbers of their own
    at_hand = assembled(system.scene)
    start = at_hand.initial_state  # by kernels that are at hand
    counted = None
    if at_hand.constraints is not None:
        counted, _ = at_hand.constraints.route("articulated", 0.0).tables()
    tables = _tables(apart, counted, derivatives)
    kinds = tuple(each._numba_type_ for each in _arguments(tables))
    base = image(tables)
    _, work = _tree(tables)

    def block(changed: Scene) -> Image | None:
        other = _tables(system.with_numbers(changed), counted, derivatives)
        same = all(each._numba_type_ == kind for each, kind in zip(_arguments(other), kinds, strict=True))
        if not same or list(map(_shapes, flattened(other))) != list(map(_shapes, flattened(tables))):
            return None
        return _without_doubt(image(other, base), tables)

    found = numbers(system.scene, _without_doubt(base, tables), block)
    identifier = _identifier(scene.name)
    q, u = system.state_names
    names = (*q, *u, ("work", "J"))
    states = tuple(Variable(*each, float(value)) for each, value in zip(names, start.y, strict=True))
    links = tuple(link.name for link in system.links)
    closed = tables[C] if isinstance(tables[C], Closed) else None
    open_loads, branch = "", dict[str, tuple[int, int]]()
    if closed is not None:
        if int(closed.cw.rank.sum()) < len(closed.cc.row):
            open_loads = (
                "loads of hinges and closures, and drives, are no outputs: closures are redundant, and the motion does "
                "not determine how they share their loads (flexmb.System.determined_loads says which); a joint that "
                "suppresses fewer motions makes them unique"
            )
        branch = _remembered(base, number_of(tables, closed.cw))
    outputs = tuple(_outputs(system, tables[OUT], base, not open_loads))
    return ExportedModel(
        scene.name, scene.description, identifier, _digest(scene), _digest(without_start(scene)), states, system.nq,
        found, outputs, base, timing_of(system), links,
        tuple(system.observed_names.connectors), base.word(number_of(tables, work), "fault"),
        tuple(each.name for each in system.scene.constraints), branch, open_loads,
        _tangent(tables, base, outputs) if derivatives else None, b"",
    ), kinds  # fmt: skip


def memory(system: System) -> Image:
    """The block of memory that an instance of the system has."""
    return image(_tables(system))


def _tables(system: System, counted: Closed | None = None, derivatives: bool = False) -> tuple[Any, ...]:
    """The bundles C, W, OUT, and TANGENT; counted: a chain of the same closures whose independent rows have been
    counted."""
    out, size = system.observation.outputs(), (system.nq, system.nu)
    if system.constraints is None:
        c = system.explicit_constants
        tree = c, workspace(c, *size), out
        return (*tree, entry.tree_tangent(system.derivative_constants, *size, out)) if derivatives else tree
    chain = system.constraints.closures.chain("articulated")
    if counted is not None:
        chain.cw.rank[:], chain.cw.size[:] = counted.cw.rank, counted.cw.size
    closed = chain, entry.EndLoads(np.zeros((len(chain.cc.closure), 6))), out
    return (*closed, entry.chain_tangent(chain, *size, out)) if derivatives else closed


def _arguments(tables: tuple[Any, ...]) -> tuple[Any, ...]:
    """The bundles that entry points take: these, and after TANGENT what its kernels take before it."""
    return (*tables, _differentiated(tables)) if len(tables) > TANGENT else tables


def _differentiated(tables: tuple[Any, ...]) -> Any:
    """The constants, or the chain, of the derivatives."""
    return tables[C] if isinstance(tables[C], Closed) else tables[TANGENT].c


def _tangent(tables: tuple[Any, ...], block: Image, outputs: Sequence[Output]) -> Tangent:
    """Places of the derivatives: of each output, the first derivative in the dual number that has its place."""
    x, numbers = tables[TANGENT], (OUT, OUT, W)
    own = number_of(tables, x.out)
    twins = [(own, "every"), (own, "drives")]
    if isinstance(tables[C], Closed):
        twins.append((number_of(tables, x.rows), "loads"))
    places = list[int]()
    for output in outputs:
        word = output.word
        for number, (twin, name) in zip(numbers, twins, strict=False):
            first, (_, size) = block.word(number, name), block.arrays[number, name]
            if first <= output.word < first + size // ROW:
                word = block.word(twin, name) + DUAL.width * (output.word - first) + 1
        places.append(word)
    return Tangent(
        block.bundles[TANGENT], block.bundles[number_of(tables, _differentiated(tables))],
        block.word(TANGENT, "J"), block.word(TANGENT, "direction"), tuple(places),
    )  # fmt: skip


def _tree(tables: tuple[Any, ...]) -> tuple[Any, Any]:
    """Constants and workspace of the tree."""
    chain = tables[C]
    return (chain.c, chain.w) if isinstance(chain, Closed) else tables[:2]


def _remembered(block: Image, number: int) -> dict[str, tuple[int, int]]:
    return {name: (at // ROW, size // ROW) for (of, name), (at, size) in block.arrays.items() if of == number}


def _shapes(bundle: Any) -> list[tuple[int, ...]]:
    arrays = (getattr(bundle, name) for name in bundle.__dataclass_fields__)
    return [array.shape for array in arrays if isinstance(array, np.ndarray)]


def _without_doubt(block: Image, tables: tuple[Any, ...]) -> Image:
    """The block without the size below which a pivot is doubtful: an exported model does not ask for it."""
    words = block.words.copy()
    for number, constants in enumerate(flattened(tables)):
        if isinstance(constants, Constants) and len(constants.speed):
            speed, first = constants.speed, block.word(number, "speed")
            place = speed["doubtful"].ctypes.data - speed.ctypes.data
            words[first + place // ROW :: speed.itemsize // ROW][: len(speed)] = 0.0
    return Image(words, block.stored, block.addresses, block.bundles, block.arrays)


def machine_code(identifier: str, kinds: tuple[Any, ...], target: str = LEVEL) -> bytes:
    """An object file with the entry points for tables of these types, which `tabled` gives; for one of `TARGETS`."""
    (c, w, out), state = kinds[:TANGENT], (REAL, WHOLE, WHOLE)
    rates, outputs, settle = entry.rates, entry.outputs, entry.settle
    derivatives, along = entry.derivatives, entry.outputs_along
    if c.of is Closed:
        rates, outputs, settle = entry.chain_rates, entry.chain_outputs, entry.chain_settle
        derivatives, along = entry.chain_derivatives, entry.chain_outputs_along
    entries: dict[str, tuple[Callable[..., Any], tuple[Any, ...]]] = {
        f"{identifier}_kernel_rates": (rates, (*state, WHOLE, c, w)),
        f"{identifier}_kernel_outputs": (outputs, (*state, c, w, out)),
        f"{identifier}_kernel_settle": (settle, (*state, c)),
    }
    if len(kinds) > TANGENT:
        tangent, constants = kinds[TANGENT:]
        entries[f"{identifier}_kernel_derivatives"] = derivatives, (*state, constants, tangent)
        entries[f"{identifier}_kernel_outputs_along"] = along, (*state, constants, tangent)
    return emitted(entries, target)


def _outputs(system: System, out: Any, block: Image, loads: bool) -> Iterator[Output]:
    """Everything observable, in the order of a trajectory's columns; rotations are matrices.

    loads: with those of hinges and closures, and drives.
    """
    names = system.observed_names

    def place(array: Real) -> int:
        return block.word(OUT, "every") + (array.ctypes.data - out.every.ctypes.data) // ROW

    def columns(kind: Kind, name: str, first: int, width: int) -> Iterator[Output]:
        for i, (label, unit) in enumerate(labels(kind, name, width)):
            yield Output(label, unit, first + i)

    for i, name in enumerate(names.markers):
        first = place(out.markers[i])
        yield from columns("position", name, first, 3)
        for k in range(9):
            yield Output(f"{name}.rotation[{k // 3 + 1},{k % 3 + 1}]", "1", first + 3 + k)
        yield from columns("velocity", name, first + 12, 6)
        yield from columns("acceleration", name, first + 18, 6)
    spatial: tuple[tuple[Kind, Sequence[str], Real], ...] = (
        ("loads", names.hinges if loads else (), out.loads), ("wheel_loads", names.wheels, out.wheel_loads),
        ("connectors", names.connectors, out.connectors),
    )  # fmt: skip
    for kind, whose, rows in spatial:
        for i, name in enumerate(whose):
            yield from columns(kind, name, place(rows[i]), 6)
    for i, each in enumerate(system.scene.constraints if loads else ()):
        yield from columns("loads", each.name, block.word(W, "loads") + 6 * i, 6)
    for name, places in names.driven.items() if loads else ():
        for i, speed in enumerate(places.tolist()):
            unit = {"rad/s": "N m", "m/s": "N"}[system.state_names[1][speed][1]]
            yield Output(f"{name}.drive[{i}]", unit, block.word(OUT, "drives") + speed)
    along = {each.name: each for each in system.scene.connectors if isinstance(each, AlongHinge)}
    for i, name in enumerate(names.hinge_forces):
        unit = "N m" if along[name].ANGULAR else "N"
        yield Output(f"{name}.hinge_force", unit, place(out.hinge_forces[i:]))
    for i, name in enumerate(ENERGIES):
        yield Output(f"energy.{name}", "J", place(out.energy[i:]))
    yield Output("energy.total", "J", TOTAL)
    yield from columns("momentum", "momentum", place(out.momentum), 6)


def _digest(scene: Scene) -> str:
    return sha256(dumps(scene).encode()).hexdigest()


def _identifier(name: str) -> str:
    """The name of a scene as one of C."""
    word = re.sub(r"\W", "_", name, flags=re.ASCII).strip("_") or "scene"
    return word if word[0].isalpha() else f"model_{word}"


ADVICE = {int(status): status.advice for status in Status if status is not Status.OK}
"""What the kernels' status codes mean, by their numbers."""
