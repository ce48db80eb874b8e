"""The comparison of an appendage with spring-hinged rigid models as tables in a terminal."""

from __future__ import annotations

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from flexmb.frisch.equivalence.comparison import BEST, Direction, Equivalence, percent
from flexmb.frisch.equivalence.relations import HingeFit, Relation, displacement_relations, modal_effective_inertia
from flexmb.output.listing import Listing, figures, names, prose
from flexmb.typing import Real

_UNITS = {149: "m/s", 150: "kg m^2/s", 151: "kg m^2/s", 47: "m", 49: "kg m^2"}
_SHOWN_MODES = 4
_COLOURS = {"rigid": "cyan", "flexible": "magenta", "either": "green"}


def equivalence_tables(result: Equivalence, angle: float = 0.1) -> RenderableType:
    """Mismatches and hinges, modes needed, and verdicts; `angle` rad of the hinge for the displacement forms."""
    return Group(
        _heading(result), *(_mismatches(result, i, angle) for i in range(len(_lead(result).modes))), _hinges(result),
        _modes(result), _verdicts(result),
    )  # fmt: skip


def _lead(result: Equivalence) -> HingeFit:
    return next(iter(result.fits.values()))


def _heading(result: Equivalence) -> Text:
    body = result.appendage
    f = ", ".join(f"{value:.4g}" for value in body.frequencies[:_SHOWN_MODES] / (2.0 * np.pi))
    modes = f"{body.mode_count} modes, {f}{' ...' if body.mode_count > _SHOWN_MODES else ''} Hz"
    centre = _vector(body.parameters.alpha)
    words = f": {body.parameters.mass:.4g} kg, mass centre {centre} m from the clamp, {modes}"
    return Text.assemble((body.name, "bold"), words)


def _mismatches(result: Equivalence, i: int, angle: float) -> Listing:
    """Relations of the i-th hinge axis and its mode: size of the modal side, mismatch of each hinge."""
    body, mode = result.appendage, _lead(result).modes[i]
    frequency = body.frequencies[mode] / (2.0 * np.pi)
    columns = (*figures("equation"), *names("quantity"), *figures("modes", *result.fits))
    table = Listing(
        *columns, title=f"\nMismatch with mode {mode + 1}, {frequency:.4g} Hz",
        caption="Parts of the root-mean-square velocity (displacement) of the appendage; modes: size of their side "
        "while the best hinge turns at 1 rad/s. In a vibration accelerations, (160), (159), mismatch as (149), (151).",
    )  # fmt: skip
    fits = list(result.fits.values())
    for relations in zip(*(fit.relations[i] for fit in fits), strict=True):
        size = float(np.linalg.norm(relations[0].flexible)) / abs(result.fits[BEST].rates[i, i])
        unit = _UNITS[relations[0].equation]
        table.add(*_words(relations[0], f"{size:.4g} {unit}"), *_mismatch(relations, result))
    shape = np.eye(body.mode_count)[mode]
    turned = [displacement_relations(body, fit.hinge, shape * angle / fit.rates[i, i]) for fit in fits]
    for relations in zip(*turned, strict=True):
        table.add(*_words(relations[0], f"at {angle:g} rad"), *_mismatch(relations, result))
    return table


def _words(relation: Relation, size: str) -> tuple[str, str, str]:
    return f"({relation.equation})", relation.quantity, size


def _mismatch(relations: tuple[Relation, ...], result: Equivalence) -> list[Text]:
    return [
        Text(percent(relation.mismatch), style="green" if relation.mismatch <= result.accuracy else "yellow")
        for relation in relations
    ]


def _hinges(result: Equivalence) -> Listing:
    """The rigid models themselves, and the loads that they and their modes exert on the base."""
    body = result.appendage
    caption = "Effective mass and inertia, of the rigid body's, follow the vibration; the rest follows the base."
    columns = (*names(""), *figures("modes", *result.fits))
    table = Listing(*columns, title="\nSpring-hinged rigid models", caption=caption)
    fits = list(result.fits.values())
    lead = fits[0]
    table.add("norm of the mismatches", "", *(percent(fit.mismatch) for fit in fits))
    table.add("point from the clamp (m)", "", *(_vector(fit.hinge.point) for fit in fits))
    modal = modal_effective_inertia(body, lead.modes)
    for i, (axis, mode) in enumerate(zip(lead.hinge.axes, lead.modes, strict=True)):
        named = _vector(axis)
        table.add(f"spring about {named} (N m/rad)", "", *(f"{fit.hinge.stiffness[i]:.5g}" for fit in fits))
        velocity = body.parameters.A[mode]
        rows = [(f"effective inertia about {named}", slice(0, 3), axis)]
        if np.linalg.norm(velocity) > 1e-6:
            across = velocity / np.linalg.norm(velocity)
            rows.append((f"effective mass along {_vector(np.abs(across))}", slice(3, 6), across))
        for label, part, along in rows:
            whole = along @ body.rigid_inertia[part, part] @ along
            inertias = [modal, *(fit.effective_inertia for fit in fits)]
            table.add(label, *(percent(along @ one[part, part] @ along / whole) for one in inertias))
    frequencies = [body.frequencies[sorted(lead.modes)], *(fit.frequencies for fit in fits)]
    table.add("frequency (Hz)", *(", ".join(f"{f:.5g}" for f in some / (2.0 * np.pi)) for some in frequencies))
    return table


def _modes(result: Equivalence) -> Listing:
    """How many modes each motion of the base needs."""
    shown = min(_SHOWN_MODES, result.appendage.mode_count)
    modes = (str(n + 1) for n in range(shown))
    table = Listing(
        *names("base moves"), *figures("inertia", "needed", "acting", *modes, "all"),
        title=f"\nModes needed for {percent(result.accuracy)}",
        caption="Parts of the rigid body's inertia about the clamp, or mass, that modes 1, 2, ... and all of them "
        "carry away from the base. Turning needs (149)-(151) within the accuracy as well. Acting: modes that move so "
        "at all.",
    )  # fmt: skip
    for direction in result.directions:
        unit = "kg m^2" if direction.name.startswith("about") else "kg"
        shares = [percent(share) if share > 1e-6 else "-" for share in direction.mode_shares[:shown]]
        total = percent(max(1.0 - direction.remainder[-1], 0.0))
        inertia = f"{direction.inertia:.4g} {unit}"
        table.add(direction.name, inertia, *_needed(direction, result.accuracy), *shares, total)
    return table


def _needed(direction: Direction, accuracy: float) -> tuple[Text, str]:
    """Modes needed, and how many of them take part."""
    every = len(direction.mode_shares)
    acting = direction.taking_part(every)
    needed = direction.needed(accuracy)
    if needed is not None:
        return Text(str(needed)), str(direction.taking_part(needed))
    if acting == 0:
        return Text("-", style="dim"), "0"
    return Text(f"more than {every}", style="yellow"), str(acting)


def _verdicts(result: Equivalence) -> Listing:
    table = Listing(*prose("for"), *names("model"), *prose("because"), title="\nWhich model is better")
    for verdict in result.verdicts:
        table.add(verdict.question, Text(verdict.better, style=_COLOURS[verdict.better]), verdict.reason)
    return table


def _vector(vector: Real) -> str:
    """x, y, z for unit vectors along the axes, components otherwise; round-off is zero."""
    for name, unit in zip("xyz", np.eye(3), strict=True):
        if np.allclose(vector, unit, rtol=0.0, atol=1e-9):
            return name
    size = float(np.max(np.abs(vector)))
    clean = np.where(np.abs(vector) > 1e-9 * size, vector, 0.0)
    return "(" + ", ".join(f"{component:.4g}" for component in clean) + ")"
