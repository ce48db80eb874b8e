"""The entry point: the gradient of one scalar of a whole run by many numbers of its scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Unpack

import numpy as np

from flexmb.building.numbering import speeds_at_least
from flexmb.integrate.control import ACCEPTED
from flexmb.integrate.integrator import Method
from flexmb.integrate.settings import Settings
from flexmb.run.simulate import RunSettings, refuse_unknown, run_with_course
from flexmb.run.times import refuse_large_run
from flexmb.run.trajectory import Trajectory
from flexmb.scene.check import check_and_warn
from flexmb.scene.problems import closest
from flexmb.scene.schema import Scene
from flexmb.scene.sizes import refuse_bytes
from flexmb.sensitivity.adjoint.run_backwards import Adjoint
from flexmb.sensitivity.channels import refuse_undetermined, refuse_unknown_outputs
from flexmb.sensitivity.gate import admitted, is_passed_backwards
from flexmb.sensitivity.parts import Passage
from flexmb.sensitivity.readings import ScalarReading, summed_forwards
from flexmb.sensitivity.scalars import ScalarTerm, terms_of
from flexmb.sensitivity.sensitivities import METHODS, SHARE
from flexmb.tables import arguments
from flexmb.tables.state import DynamicsError
from flexmb.typing import Real


@dataclass(frozen=True)
class Gradient:
    """A scalar of a run and its derivatives by numbers of the scene, by `gradient`.

    value; parameters (P,) with their values parameter_values (P,); derivatives (P,), each in the unit of the scalar
    over that of the parameter, in SI units; steps: of the run, each of which was made three times and passed backwards
    once; checkpoints: states that were kept for this, none where derivatives were integrated forwards; trajectory: the
    run itself, at its start and end.
    """

    value: float
    parameters: tuple[str, ...]
    parameter_values: Real
    derivatives: Real
    steps: int
    checkpoints: int
    trajectory: Trajectory

    def __repr__(self) -> str:
        """Its size, for an interactive prompt."""
        return f"<Gradient of a scalar, {self.value:g}, by {len(self.parameters)} parameters>"

    def derivative(self, parameter: str) -> float:
        """By one parameter; ValueError for other names."""
        if parameter not in self.parameters:
            raise ValueError(f"there is no parameter {parameter!r} here: {closest(parameter, self.parameters)}")
        return float(self.derivatives[self.parameters.index(parameter)])


def gradient(
    scene: Scene,
    t_end: float,
    by: Sequence[str],
    of: ScalarTerm | Sequence[ScalarTerm],
    method: Method = "dop853",
    **settings: Unpack[RunSettings],
) -> Gradient:
    """The gradient of a scalar of a run from t = 0 to `t_end` (s) by many numbers of its scene: the discrete adjoint.

    by: paths as for `sensitivities`, which is cheaper for a few numbers and gives whole outputs. of: a `FinalValue`, a
    `Misfit` or a `TimeIntegral` of channels as in `Trajectory.columns`, or a list of them, which are added. settings:
    see `simulate`.

    The steps of the run are passed backwards with the transposes of their stages, which is the exact derivative of what
    the method computed with these steps; events by the transposes of their derivatives. The cost hardly depends on how
    many numbers there are. Through continuous controllers and events that watch signals the adjoint does not pass: of
    such scenes derivatives are integrated forwards, as `sensitivities` does, at its cost. Raises what `sensitivities`
    raises, and DynamicsError for a run that ends before t_end, and for outputs that redundant closures leave
    undetermined.
    """
    refuse_unknown("gradient", settings)
    if method not in METHODS:
        names = " or ".join(f'"{name}"' for name in METHODS)
        raise ValueError(f'method "{method}" does not integrate derivatives: use {names}')
    t_end, terms = arguments.number("t_end", t_end), terms_of(of)
    check_and_warn(scene, t_end, 0.0)
    given = Settings(method, **settings).checked(abs(t_end))
    refuse_large_run(scene, 2, given, "articulated")
    n = 2 * speeds_at_least(scene)
    remedy = "take a scene of fewer bodies or modes, or `sensitivities` by fewer numbers"
    refuse_bytes(8.0 * n * (n + len(by)), f"derivatives of {n} coordinates and speeds by themselves take", remedy)
    gated = admitted(scene, by)
    refuse_unknown_outputs(gated.system, [name for term in terms for name in term.channels])
    instants = len({probe.t for term in terms for probe in term.probes(t_end, [])})  # refuses what does not fit the run
    if not is_passed_backwards(scene):  # each instant keeps the derivatives of the state
        what = f"derivatives of {n} coordinates and speeds by {len(by)} numbers at {instants} instants take"
        refuse_bytes(8.0 * instants * n * (1 + len(by)), what, "give fewer panels or numbers")
    trajectory, course = run_with_course(gated.system, np.array([0.0, t_end]), given)
    if not trajectory.finished or trajectory.t[-1] < t_end:
        raise DynamicsError(f"there is no gradient of a run that does not reach t = {t_end:g} s: {trajectory.message}")
    refuse_undetermined(trajectory, [name for term in terms for name in term.channels])
    reading, found = ScalarReading(terms, course, given), gated.numbers
    steps, checkpoints = sum(int(leg.raw.counts[ACCEPTED]) for leg in course), 0
    if is_passed_backwards(scene):
        adjoint = Adjoint(gated, reading, given)
        derivatives = adjoint(course)
        steps, checkpoints = adjoint.cost.steps, adjoint.cost.checkpoints
    else:
        scales = np.array([SHARE * number.scale for number in found])
        passage = Passage(gated, found, scales, given, t_end)
        derivatives = summed_forwards(passage, reading, course, len(found)) / scales
    return Gradient(
        reading.value, tuple(number.name for number in found), np.array([number.value for number in found]),
        derivatives, steps, checkpoints, trajectory,
    )  # fmt: skip
