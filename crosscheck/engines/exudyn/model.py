"""A scene compiled for Exudyn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crosscheck.engines.contract import Effort, MarkerPath, Run, Snapshot, Trajectory
from crosscheck.engines.exudyn.balance import energy_and_momentum
from crosscheck.engines.exudyn.connections import Connected, connected, marker_path, marker_snapshot
from crosscheck.engines.exudyn.independent import independent, opening
from crosscheck.engines.exudyn.kkt import body_mass_matrix, initial_state
from crosscheck.engines.exudyn.modal import NodeShape
from crosscheck.engines.exudyn.solve import ExudynSolution, integrate
from crosscheck.engines.exudyn.state import CarrierPath, States, carrier_path
from crosscheck.engines.exudyn.wrench import drives, link_wrenches
from crosscheck.engines.linear.outputs import NOTHING, LinearOutputs
from flexmb.scene.schema import Marker, Scene
from flexmb.typing import Real


class ExudynModel:
    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.assembly, self._whole = independent(scene)

    def warm_up(self) -> None:
        """Nothing to compile."""

    def evaluate(self) -> Snapshot:
        states = initial_state(self.assembly)
        paths = self._paths(states)
        loads, energy, momentum, held = self._loads_and_balance(states, paths)
        markers = {
            marker.name: marker_snapshot(*self._located(marker, paths), np.array(marker.offset_m))
            for marker in self.scene.markers
        }
        first = {name: values[0] for name, values in loads.items()}
        return Snapshot(
            markers=markers,
            loads={name: first[name] for name in self._loaded},
            wheel_loads={name: first[name] for name in self.assembly.wheels},
            drives={name: values[0] for name, values in drives(self.assembly, states).items()},
            energy={kind: float(values[0]) for kind, values in energy.items()},
            momentum=momentum[0],
            connectors={name: motions[0] for name, motions in held.between.items()},
            hinge_forces={name: motions[0] for name, motions in held.along.items()},
        )

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        solution = self._still_closed(integrate(self.assembly, run.times, effort))
        states = solution.states
        # the solvers' own first multipliers are good to 1e-7 only
        states.multipliers[:1] = initial_state(self.assembly).multipliers
        paths = self._paths(states)
        loads, energy, momentum, held = self._loads_and_balance(states, paths)
        linear = self._linearised(run, states)
        return Trajectory(
            status=solution.status, message=solution.message, times=run.times[: len(states.times)],
            markers=self._markers(paths), loads={name: loads[name] for name in self._loaded},
            wheel_loads={name: loads[name] for name in self.assembly.wheels},
            drives=drives(self.assembly, states), energy=energy, momentum=momentum,
            connectors=held.between, hinge_forces=held.along,
            wall_s=solution.wall_s, evaluations=solution.evaluations, steps=solution.steps, **linear.as_outputs,
        )  # fmt: skip

    def _still_closed(self, solution: ExudynSolution) -> ExudynSolution:
        """A run, cut where what was left out as redundant opens."""
        if self._whole is None:
            return solution
        good, name = opening(self._whole, solution.states)
        if not name:
            return solution
        why = f'closure "{name}" opened: rows that are redundant where the run begins are not at t = '
        at = f"{solution.states.times[good]:g} s"
        return replace(solution, states=solution.states.cut(good), status="diverged", message=why + at)

    def markers(self, states: States) -> dict[str, MarkerPath]:
        """Their motion in a run."""
        return self._markers(self._paths(states))

    def _markers(self, paths: dict[str, CarrierPath]) -> dict[str, MarkerPath]:
        return {
            marker.name: marker_path(*self._located(marker, paths), np.array(marker.offset_m))
            for marker in self.scene.markers
        }

    def _linearised(self, run: Run, states: States) -> LinearOutputs:
        if "frequencies" not in run.linear:
            return NOTHING
        from crosscheck.engines.exudyn.frequencies import frequencies  # loads SciPy

        return frequencies(self.assembly, states)

    @property
    def _loaded(self) -> list[str]:
        """Hinges and closures, whose loads are outputs."""
        return [*self.assembly.hinges, *self.assembly.closures]

    def mass_matrix(self, body: str | None = None) -> Real:
        """(m+6, m+6) of a flexible body, [modes; angular; linear] in its body axes; of the only one by default."""
        bending = [name for name, placed in self.assembly.bodies.items() if placed.carrier.flexible is not None]
        return body_mass_matrix(self.assembly, body or bending[0])

    def _located(self, item: Marker, paths: dict[int, CarrierPath]) -> tuple[CarrierPath, NodeShape]:
        placed = self.assembly.bodies[item.body].at(item.node)
        return paths[placed.carrier.key], placed.shape(item.node)

    def _paths(self, states: States) -> dict[int, CarrierPath]:
        """Motion of every carrier that a joint holds or that has mass, by its node."""
        carriers = [self.assembly.shop.ground, *self.assembly.carriers]
        for link in self.assembly.links.values():
            carriers += [carrier for stage in link.stages for carrier in (stage.inboard, stage.outboard)]
            carriers += list(link.spherical[1:]) if link.spherical else []
        for element in self.assembly.elements:
            carriers += [element.left, element.right]
        return {key: carrier_path(self.assembly, c, states) for key, c in {c.key: c for c in carriers}.items()}

    def _loads_and_balance(
        self, states: States, paths: dict[int, CarrierPath]
    ) -> tuple[dict[str, Real], dict[str, Real], Real, Connected]:
        loads = link_wrenches(self.assembly, states, paths)
        energy, momentum = energy_and_momentum(self.assembly, states, paths)
        held = connected(self.assembly, states, paths)
        energy["spring"] = energy["spring"] + held.energy
        return loads, energy, momentum, held
