"""A beam of Kratos' elements CrBeamElement3D2N, and Kratos' time integration of it.

The element is Krenk's corotational beam: straight, of two nodes, of finite rotations and small strains, with the exact
stiffness of a straight beam in its own axes, and a consistent mass matrix. Its moduli are products of Young's modulus
and areas, so that with a modulus of one every stiffness of a section is stated by itself. It keeps the rotations of its
ends as quaternions, which Newton's method moves on at every iteration; the nodes' ROTATION is the sum of all these
increments, no rotation vector. An increment is twice the vector part of a quaternion: 2 sin(angle/2) about its axis.

Kratos' Bossak and Newmark schemes give angular velocities and accelerations to no node, so that rotary inertia is lost
there. Its scheme of backward differences, of second order, integrates rotations as it does displacements.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sin

import numpy as np

from crosscheck.engines.functions_of_time import profile
from crosscheck.engines.kratos import library
from crosscheck.engines.kratos.layout import BeamLayout, Section
from flexmb.scene.schema import Load
from flexmb.typing import Real

ORDER = 2
"""Of the backward differences: their two last states are kept."""
TOLERANCE, NEGLIGIBLE, MOST_ITERATIONS = 1e-8, 1e-11, 40
"""Newton's method ends at increments below either: relative to all displacements and rotations, and in m and rad as
their root mean square."""
JUMP_WINDOW = 1e-9
"""Relative distance in time at which a step's end and a jump of a load are the same."""
PARTS = {"force": slice(0, 3), "torque": slice(3, 6)}
SHEAR_MODULUS = 0.5  # of Young's modulus 1 and Poisson's ratio 0


class Mesh:
    """The beam in Kratos at t = 0, before any step, and what has to be known of it."""

    def __init__(self, layout: BeamLayout) -> None:
        self.layout = layout
        self.core, self.structural = library.load()
        core = self.core
        self._model = core.Model()  # which owns the part
        self.part = self._model.CreateModelPart("beam", ORDER + 1)
        self.part.ProcessInfo[core.DOMAIN_SIZE] = 3
        self.translation = (core.DISPLACEMENT, core.VELOCITY, core.ACCELERATION)
        self.rotation = (core.ROTATION, core.ANGULAR_VELOCITY, core.ANGULAR_ACCELERATION)
        applied = (core.REACTION, core.REACTION_MOMENT, core.VOLUME_ACCELERATION)
        self._pulls = {"force": self.structural.POINT_LOAD, "torque": self.structural.POINT_MOMENT}
        for variable in (*self.translation, *self.rotation, *applied, *self._pulls.values()):
            self.part.AddNodalSolutionStepVariable(variable)
        self.nodes = [self.part.CreateNewNode(k, *place) for k, place in enumerate(layout.position, start=1)]
        self.elements = [
            self._element(k, *each) for k, each in enumerate(zip(layout.sections, layout.axes, strict=True), 1)
        ]
        self._freedoms()
        gravity = layout.to_model(layout.scene.gravity_m_s2)
        for node in self.nodes:
            node.SetSolutionStepValue(core.VOLUME_ACCELERATION, core.Array3(gravity.tolist()))
        self._loads = [
            (self._loaded(number, load), load.type, layout.to_model(load.direction), profile(load.function))
            for number, load in enumerate(layout.scene.loads, start=1)
        ]
        rotation = getattr(layout.scene.hinges[0], "rotation", None)
        function = None if rotation is None else rotation.prescribed_rad
        self._angle = None if function is None else profile(function)

    def _element(self, number: int, section: Section, axes: Real):
        core, structural = self.core, self.structural
        properties = self.part.CreateNewProperties(number)
        area, mass = section.EA, section.mass / section.EA
        x, y, z = (each / mass for each in section.rotary)
        for key, value in {
            core.YOUNG_MODULUS: 1.0, core.POISSON_RATIO: 0.0, core.DENSITY: mass, structural.CROSS_AREA: area,
            structural.TORSIONAL_INERTIA: section.GJ / SHEAR_MODULUS, structural.I22: section.EIy,
            structural.I33: section.EIz, structural.AREA_EFFECTIVE_Y: section.GAy / SHEAR_MODULUS,
            structural.AREA_EFFECTIVE_Z: section.GAz / SHEAR_MODULUS, structural.MASS_MOMENT_OF_INERTIA: x,
            structural.INERTIA_ROT_Y: y, structural.INERTIA_ROT_Z: z,
        }.items():  # fmt: skip
            properties.SetValue(key, value)
        properties.SetValue(core.CONSTITUTIVE_LAW, structural.BeamConstitutiveLaw())
        element = self.part.CreateNewElement("CrBeamElement3D2N", number, [number, number + 1], properties)
        element.SetValue(core.LOCAL_AXIS_2, core.Array3(axes[:, 1].tolist()))
        return element

    def _freedoms(self) -> None:
        core, add = self.core, self.core.VariableUtils().AddDof
        self._components = [getattr(core, f"{kind}_{axis}") for kind in ("DISPLACEMENT", "ROTATION") for axis in "XYZ"]
        reactions = [getattr(core, f"{kind}_{axis}") for kind in ("REACTION", "REACTION_MOMENT") for axis in "XYZ"]
        for component, reaction in zip(self._components, reactions, strict=True):
            add(component, reaction, self.part)
        for held in self.layout.held:
            self.nodes[self.layout.root].Fix(self._components[held])

    def _loaded(self, number: int, load: Load) -> int:
        """The node at which a load acts, which gets what applies loads there."""
        node = self.layout.node_at(load.node)
        kind = "PointLoadCondition3D1N" if load.type == "force" else "PointMomentCondition3D1N"
        if not any(
            self.layout.node_at(other.node) == node and other.type == load.type
            for other in self.layout.scene.loads[: number - 1]
        ):
            self.part.CreateNewCondition(kind, number, [node + 1], self.part.Properties[1])
        return node

    def load(self, t: float, side: float) -> Real:
        """Apply all loads at t; forces and torques (n,6) on the nodes in model axes. Where one jumps within rounding of
        t, `side` says which of its values counts: -1 before, 1 after."""
        at = t * (1.0 + side * JUMP_WINDOW)
        applied = np.zeros((len(self.nodes), 6))
        for node, kind, direction, function in self._loads:
            applied[node, PARTS[kind]] += function(at).value * direction
        for node, kind, *_ in self._loads:
            self.nodes[node].SetSolutionStepValue(
                self._pulls[kind], self.core.Array3(applied[node, PARTS[kind]].tolist())
            )
        return applied

    def turn(self, before: float, t: float) -> None:
        """Turn the root by what is prescribed between two times."""
        if self._angle is not None:
            node, component = self.nodes[self.layout.root], self._components[5]
            by = 2.0 * sin((self._angle(t).value - self._angle(before).value) / 2.0)
            node.SetSolutionStepValue(component, node.GetSolutionStepValue(component) + by)

    def prescribed_acceleration(self, t: float) -> float:
        """Of the root's rotation (rad/s²), zero where none is prescribed."""
        return 0.0 if self._angle is None else self._angle(t).acceleration

    def strategy(self):
        """Kratos' solution of one step, and its scheme."""
        core = self.core
        settings = '{"domain_size": 3, "integration_order": %d, "solution_variables": ["DISPLACEMENT", "ROTATION"]}'
        scheme = core.ResidualBasedBDFCustomScheme(ORDER, core.Parameters(settings % ORDER))
        builder = core.ResidualBasedBlockBuilderAndSolver(core.SkylineLUFactorizationSolver())
        criterion = core.DisplacementCriteria(TOLERANCE, NEGLIGIBLE)
        strategy = core.ResidualBasedNewtonRaphsonStrategy(
            self.part, scheme, criterion, builder, MOST_ITERATIONS, False, False, True
        )
        strategy.SetEchoLevel(0)
        strategy.Initialize()
        return strategy, scheme

    def set_out(self) -> None:
        """The velocities at t = 0."""
        for node, velocity in zip(self.nodes, self.layout.velocity, strict=True):
            node.SetSolutionStepValue(self.core.VELOCITY, self.core.Array3(velocity.tolist()))
            node.SetSolutionStepValue(self.core.ANGULAR_VELOCITY, self.core.Array3(self.layout.spin.tolist()))

    def begin(self, t: float, step: float, accelerations: Real) -> None:
        """The present state, with accelerations (n,6), is that at t; the steps before it had the same accelerations."""
        now = [(names, self.table(names[:1]), self.table(names[1:2])) for names in (self.translation, self.rotation)]
        for ago in (step * back for back in range(ORDER, -1, -1)):
            self.part.CloneTimeStep(t - ago)
            for (names, value, rate), a in zip(now, (accelerations[:, :3], accelerations[:, 3:]), strict=True):
                past = (value - ago * rate + ago**2 / 2.0 * a, rate - ago * a, a)
                for name, rows in zip(names, past, strict=True):
                    for node, row in zip(self.nodes, rows.tolist(), strict=True):
                        node.SetSolutionStepValue(name, self.core.Array3(row))

    def table(self, variables: Sequence) -> Real:
        """Vectors of all nodes (n, 3 len(variables))."""
        return np.array(
            [np.concatenate([node.GetSolutionStepValue(each) for each in variables]) for node in self.nodes]
        )

    def of_elements(self, name: str, which: slice = slice(None)) -> Real:
        """Matrices (k,12,12), or vectors (k,12), of elements in model axes: "MassMatrix", "RightHandSide"."""
        kind, info = self.core.Matrix if name.endswith("Matrix") else self.core.Vector, self.part.ProcessInfo
        found = []
        for element in self.elements[which]:
            value = kind()
            getattr(element, f"Calculate{name}")(value, info)
            found.append(np.array(value))
        return np.array(found)
