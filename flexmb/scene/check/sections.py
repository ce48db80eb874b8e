"""Checks of the sections of beams: complete, positive stiffness, possible inertia, and strains that the beam has."""

from __future__ import annotations

from collections.abc import Iterator
from math import sqrt

import numpy as np

from flexmb.scene.bodies import BeamBody, BeamStation, Matrix6
from flexmb.scene.check.numbers import in_range
from flexmb.scene.problems import Defect, Doubt, Place
from flexmb.scene.rounding import PRINTED
from flexmb.scene.sections import (
    INERTIA_KEYS,
    SHEAR_KEYS,
    STIFFNESS_KEYS,
    STRAINS,
    WITHOUT_SHEAR,
    free_shear,
    is_plain,
    mass_centres,
    mass_per_length,
    stiffness_on_axis,
    symmetric,
    without_shear,
)
from flexmb.scene.strains import STRAINS as POLYNOMIALS
from flexmb.scene.strains import families, polynomials
from flexmb.typing import Real

# Axial wave speed sqrt(EA / mass per length): soft rubber has some 50 m/s, diamond 18 km/s. The limits are wider than
# any structure that is built; the soft benchmark beams of the literature (100 m/s) are inside.
WAVE_SPEED = (50.0, 20_000.0)  # m/s
THICKEST = 0.5  # radius of gyration over length: beyond it nothing is slender
# GJ / (EIy + EIz) and GA / EA are below 0.75 for isotropic materials; laminates reach a few times that.
STIFFEST_SHEAR = 10.0
FAMILY_OF_STRAIN = ("axial", "bending_y", "bending_z", "torsion", "bending_z", "bending_y")


def stations(place: Place, body: BeamBody) -> Iterator[Defect]:
    """Problems of the stations of a beam, each by itself and with what the beam's modes can show of them."""
    sound = 0
    for i, station in enumerate(body.stations):
        spot = place.key("stations", i)
        stations = [*_complete(spot, station, body.theory == "timoshenko")]
        if not stations:
            stations = [*_matrices(spot, station, body)]
        yield from stations
        if not stations and in_range(station):
            yield from _plausible(spot, station, body.length_m)
            sound += 1
            if body.level != "exact" and body.length_m > 0.0 and not is_plain(station):
                yield from _shown(place, spot, station, body)
    if body.level == "exact" and sound == len(body.stations):
        yield from _strained(place, body)


def _complete(spot: Place, station: BeamStation, sheared: bool) -> Iterator[Defect]:
    """Stiffness and inertia are given once each, by numbers or as a matrix."""
    for matrix, needed, others in (
        ("stiffness", STIFFNESS_KEYS, SHEAR_KEYS), ("inertia", INERTIA_KEYS[:1], INERTIA_KEYS[1:]),
    ):  # fmt: skip
        given = [key for key in (*needed, *others) if getattr(station, key)]
        missing = [key for key in needed if getattr(station, key) is None]
        if getattr(station, matrix) is not None and given:
            what = f"the station has its {matrix} twice, as a matrix and by {', '.join(given)}"
            yield Defect(str(spot.key(matrix)), what, "leave out the one or the other")
        elif getattr(station, matrix) is None and missing:
            remedy = f"give {' and '.join(missing)}, or the matrix {matrix} of the section"
            yield Defect(str(spot), f"the station has no {missing[0]}", remedy)
    for key in SHEAR_KEYS:
        if sheared and station.stiffness is None and getattr(station, key) is None:
            yield Defect(str(spot), f"a Timoshenko beam needs {key}", f"add {key}, or use euler-bernoulli")


def _matrices(spot: Place, station: BeamStation, body: BeamBody) -> Iterator[Defect]:
    if station.stiffness is not None:
        yield from _stiffness(spot.key("stiffness"), station.stiffness)
    if station.inertia is not None:
        yield from _inertia(spot.key("inertia"), station.inertia, body.points == "section")


def _symmetric(place: Place, values: Matrix6) -> Iterator[Defect]:
    """A matrix is symmetric to what ten printed digits of its elements leave, relative to its diagonal."""
    matrix = np.array(values)
    gap = np.abs(matrix - matrix.T) - PRINTED * np.sqrt(np.abs(np.outer(np.diag(matrix), np.diag(matrix))))
    i, j = np.unravel_index(int(np.argmax(gap)), gap.shape)
    if gap[i, j] > 0.0:
        what = f"the matrix is not symmetric: [{i}][{j}] is {matrix[i, j]:g}, [{j}][{i}] is {matrix[j, i]:g}"
        yield Defect(str(place), what, "give the same value on both sides of the diagonal")


def _stiffness(place: Place, values: Matrix6) -> Iterator[Defect]:
    diagonal = [values[i][i] for i in range(6)]
    for i, value in enumerate(diagonal):
        if value <= 0.0:
            what = f"the stiffness of {STRAINS[i]} is {value:g}"
            remedy = "give a positive value; a beam without shear does not use those of shear"
            yield Defect(str(place.key(i, i)), what, remedy)
    if min(diagonal) <= 0.0:
        return
    defects = [*_symmetric(place, values)]
    yield from defects
    lowest, mixture = _lowest(symmetric(values))
    if not defects and lowest <= PRINTED:
        strains = " with ".join(STRAINS[i] for i in sorted(np.argsort(-np.abs(mixture))[:2]))
        what = f"the stiffness is not positive definite: a strain of {strains} costs no energy"
        remedy = "make the off-diagonal elements smaller: none may exceed the root of the product of its two diagonals"
        yield Defect(str(place), what, f"{remedy}, nor several together")


def _lowest(K: Real) -> tuple[float, Real]:
    """The lowest eigenvalue of a matrix that is scaled to a diagonal of ones, with its eigenvector."""
    size = np.sqrt(np.diag(K))
    values, vectors = np.linalg.eigh(K / np.outer(size, size))
    return float(values[0]), vectors[:, 0]


def _inertia(place: Place, values: Matrix6, flat: bool) -> Iterator[Defect]:
    """[m 1, -m c~; m c~, J] with m > 0, c in the plane of the section, and J that a distribution of mass has."""
    M = np.array(values)
    m = float(M[0, 0])
    if m <= 0.0:
        yield Defect(str(place.key(0, 0)), f"the mass per length is {m:g} kg/m", "give a positive mass")
        return
    scale = np.sqrt(np.abs(np.outer(np.diag(M), np.diag(M))))
    wanted = M.copy()
    wanted[:3, :3] = m * np.eye(3)
    wanted[:3, 3:] = [[0.0, M[0, 4], M[0, 5]], [-M[0, 4], 0.0, 0.0], [-M[0, 5], 0.0, 0.0]]
    wanted[3:, :3] = wanted[:3, 3:].T
    gap = np.abs(M - wanted) - PRINTED * np.maximum(scale, PRINTED * m)
    i, j = np.unravel_index(int(np.argmax(gap)), gap.shape)
    if gap[i, j] > 0.0:
        what = f"[{i}][{j}] is {M[i, j]:g} where the inertia of a section has {wanted[i, j]:g}"
        remedy = "write [m 1, -m c~; m c~, J]: one mass m, its centre c = (0, cy, cz), and J about the reference point"
        yield Defect(str(place.key(int(i), int(j))), what, f"{remedy}, as the page of the scene file shows")
        return
    defects = [*_symmetric(place, values)]
    yield from defects
    if not defects:
        yield from _possible(place, M, flat)


def _possible(place: Place, M: Real, flat: bool) -> Iterator[Defect]:
    """The second moments of the mass about its centre are those of a distribution of mass."""
    J = mass_centres(symmetric(M)[None])[2][0]
    size = float(np.max(np.abs(M[3:, 3:])))  # what is subtracted to refer J to the mass centre rounds like this
    S = 0.5 * np.trace(J) * np.eye(3) - J
    if float(np.linalg.eigvalsh(S)[0]) < -PRINTED * size:
        moments = ", ".join(f"{each:.6g}" for each in np.linalg.eigvalsh(J))
        what = f"no distribution of mass has this inertia: its principal moments are {moments} kg m"
        remedy = "none may be negative, and two must add up to the third at least: is J about the reference point?"
        yield Defect(str(place), f"about the mass centre {what}", remedy)
    elif flat and max(abs(S[0, 0]), abs(S[0, 1]), abs(S[0, 2])) > PRINTED * size:
        total = J[1, 1] + J[2, 2]
        what = f"the polar inertia about the mass centre is {J[0, 0]:.9g} kg m, the others add to {total:.9g}"
        remedy = 'give [3][3] = [4][4] + [5][5] and [3][4] = [3][5] = 0, or choose points = "rotary"'
        yield Defect(str(place), f'{what}, as points "section" in its plane would not have it', remedy)


def _plausible(spot: Place, station: BeamStation, length: float) -> Iterator[Doubt]:
    """Stiffnesses and masses that suggest an error of units."""
    check = "check the units, a factor of 1000 for instance"
    by_numbers = station.stiffness is None
    EA = station.EA_N if station.stiffness is None else station.stiffness[0][0]
    assert EA is not None  # `_complete` has looked
    speed = sqrt(EA / mass_per_length(station))
    if not WAVE_SPEED[0] <= speed <= WAVE_SPEED[1]:
        what = f"waves would run along the beam at {speed:.3g} m/s: no usual material does that"
        window = f"sqrt(EA / mass per length) lies in {WAVE_SPEED[0]:g} to {WAVE_SPEED[1]:g} m/s"
        place = spot.key("EA_N") if by_numbers else spot.key("stiffness", 0, 0)
        yield Doubt(str(place), what, f"{check}: {window}", "wave_speed")
    elif by_numbers:
        given = {key: getattr(station, key) for key in (*STIFFNESS_KEYS, *SHEAR_KEYS)}
        yield from _plausible_numbers(spot, given, length)


def _plausible_numbers(spot: Place, given: dict[str, float | None], length: float) -> Iterator[Doubt]:
    check = "check the units, a factor of 1000 for instance"
    EA, EIy, EIz = (float(given[key] or 0.0) for key in ("EA_N", "EIy_Nm2", "EIz_Nm2"))
    for key, EI in (("EIy_Nm2", EIy), ("EIz_Nm2", EIz)):
        gyration = sqrt(EI / EA)
        if gyration > THICKEST * length > 0.0:
            what = f"the section's radius of gyration would be {gyration:.3g} m in a beam of {length:.3g} m"
            width = f"{check}: sqrt(EI / EA) is a fraction of the section's width"
            yield Doubt(str(spot.key(key)), what, width, "thick_section")
    for key, limit in (("GJ_Nm2", EIy + EIz), ("GAy_N", EA), ("GAz_N", EA)):
        value = given[key]
        if value is not None and value > STIFFEST_SHEAR * limit:
            counterpart = "EIy + EIz" if key == "GJ_Nm2" else "EA"
            what = f"{key} is {value / limit:.3g} times {counterpart}"
            isotropic = f"{check}: G is smaller than E in every isotropic material"
            yield Doubt(str(spot.key(key)), what, isotropic, "shear_stiffness")


def _strained(place: Place, body: BeamBody) -> Iterator[Defect]:
    """Strains that a beam of level exact leaves out are coupled with none that it has: their forces would act on it."""
    own = polynomials(body)
    chosen = np.array([strain in own for strain in POLYNOMIALS])
    for station in body.stations:
        K = stiffness_on_axis(station)
        size = np.sqrt(np.diag(K))
        coupling = np.abs(K / np.outer(size, size)) * np.outer(chosen, ~chosen)
        if np.max(coupling, initial=0.0) > PRINTED:
            a, b = np.unravel_index(int(np.argmax(coupling)), coupling.shape)
            what = f"the section couples {STRAINS[a]} with {STRAINS[b]}, for which the beam has no polynomials"
            remedy = f"give {POLYNOMIALS[b]} some in modes.polynomials, or lay the axis where nothing couples them"
            yield Defect(str(place.key("modes", "polynomials")), what, remedy)
            return  # the other stations are most often the same section


def _shown(place: Place, spot: Place, station: BeamStation, body: BeamBody) -> Iterator[Defect]:
    """All that the section couples is among the strains that the beam has.

    Without shear v' = theta holds on the axis. A section that shears without shear force, for instance because its
    shear centre is off the axis, contradicts that: its twist under a force would be lost.
    """
    K, strains = stiffness_on_axis(station), list(range(6))
    chosen = np.array([family in families(body) for family in FAMILY_OF_STRAIN])
    if body.theory == "euler-bernoulli":
        own = chosen[WITHOUT_SHEAR]
        shear = np.abs(free_shear(K)[:, own]) / np.array([1.0, *[body.length_m] * 3])[own]
        if np.max(shear, initial=0.0) > PRINTED:
            with_it = STRAINS[np.array(WITHOUT_SHEAR)[own][int(np.argmax(np.max(shear, axis=0)))]]
            what = f"the section shears with {with_it}, but a beam of theory euler-bernoulli has no shear"
            remedy = 'choose theory = "timoshenko", or lay the axis of the beam through the shear centres'
            yield Defect(str(spot), what, remedy)
            return
        K, strains, chosen = without_shear(K), WITHOUT_SHEAR, own
    size = np.sqrt(np.diag(K))
    coupling = np.abs(K / np.outer(size, size)) * np.outer(chosen, ~chosen)
    if np.max(coupling, initial=0.0) > PRINTED:
        a, b = (strains[i] for i in np.unravel_index(int(np.argmax(coupling)), coupling.shape))
        what = f'the section couples {STRAINS[a]} with {STRAINS[b]}, and the modes leave out "{FAMILY_OF_STRAIN[b]}"'
        remedy = f'add "{FAMILY_OF_STRAIN[b]}" to the families, or leave out "{FAMILY_OF_STRAIN[a]}" too'
        yield Defect(str(place.key("modes", "families")), what, remedy)
