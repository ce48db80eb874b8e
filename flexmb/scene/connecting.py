"""The builder's methods for connectors: springs, dampers, actuators, bushings and friction."""

from __future__ import annotations

from typing import Self, Unpack

from numpy.typing import ArrayLike

from flexmb.scene import schema as s
from flexmb.scene.collecting import Collector
from flexmb.scene.options import ClosureFrames, FrictionOptions, HingeSpringOptions, SpringOptions, refuse_others


class ConnectorMaker(Collector):
    """A method for each kind of connector."""

    def spring_damper(self, name: str, body_a: str, body_b: str, **options: Unpack[SpringOptions]) -> Self:
        """A spring, damper and actuator along the line between nodes of two bodies ("ground" too).

        Ends: `node_a`, `position_a` (m, node axes) and the same of b. Law: `free_length` (m), `preload` (N),
        `stiffness` (N/m), `stiffening`, or `table` (m) and `loads` (N); `damping` (N s/m), `acts`, actuator `force`.
        """
        refuse_others("a SpringDamper", options, SpringOptions)
        return self._append(s.SpringDamper, name=name, body_a=body_a, body_b=body_b, **options)

    def bushing(
        self, name: str, body_a: str, body_b: str, *, stiffness: ArrayLike, damping: ArrayLike | None = None,
        **frames: Unpack[ClosureFrames],
    ) -> Self:  # fmt: skip
        """Stiffness and damping of all relative motions of two frames, symmetric (6,6): [rotation; translation] of B
        in axes of A. `frames`: as of a closure."""
        values = frames if damping is None else frames | {"damping": damping}
        return self._append(s.Bushing, name=name, body_a=body_a, body_b=body_b, stiffness=stiffness, **values)

    def angular_spring(self, name: str, hinge: str, **options: Unpack[HingeSpringOptions]) -> Self:
        """A nonlinear spring (N m/rad) along an angle of a hinge, with stops; see AngularSpring."""
        refuse_others("an AngularSpring", options, HingeSpringOptions)
        return self._append(s.AngularSpring, name=name, hinge=hinge, **options)

    def linear_spring(self, name: str, hinge: str, **options: Unpack[HingeSpringOptions]) -> Self:
        """A nonlinear spring (N/m) along a displacement of a hinge or point mass, with stops; see LinearSpring."""
        refuse_others("a LinearSpring", options, HingeSpringOptions)
        return self._append(s.LinearSpring, name=name, hinge=hinge, **options)

    def angular_friction(
        self, name: str, hinge: str, *, sliding: float, smoothing: float, **options: Unpack[FrictionOptions]
    ) -> Self:
        """Dry friction (N m) along an angle of a hinge or in a wheel's bearing, smooth below the rate `smoothing`."""
        return self._append(s.AngularFriction, name=name, hinge=hinge, sliding=sliding, smoothing=smoothing, **options)

    def linear_friction(
        self, name: str, hinge: str, *, sliding: float, smoothing: float, **options: Unpack[FrictionOptions]
    ) -> Self:
        """Dry friction (N) along a displacement of a hinge or point mass, smooth below the speed `smoothing`."""
        return self._append(s.LinearFriction, name=name, hinge=hinge, sliding=sliding, smoothing=smoothing, **options)
