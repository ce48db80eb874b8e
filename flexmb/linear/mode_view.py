"""A mode of a linear model in three dimensions."""

from __future__ import annotations

import numpy as np

from flexmb.linear.equations import built
from flexmb.linear.equilibrium import equilibrium
from flexmb.linear.linearize import linearize
from flexmb.linear.spin import steady_spin
from flexmb.scene.schema import Scene
from flexmb.view.scene_view import View, scene_view

FRAMES = 49  # of a period
AMPLITUDE = 0.15  # of the largest displacement (rad, m) of a mode


def mode_view(scene: Scene, number: int, spin: str | None = None, rate: float = 0.0) -> View:
    """Mode `number` (1 is the first of `LinearModel.modes`) about the equilibrium, drawn over one period.

    spin: a hinge or wheel that turns at `rate` (rad/s); the mode is then one about the steady spin, which a Campbell
    diagram has at that rate, seen in the rotating frame. The largest displacement has the amplitude 0.15 (rad, m, or
    modal coordinate), without growth or decay. A rigid-body motion is drawn over a second. ValueError if there is no
    such mode or spin; ArithmeticError without an equilibrium.
    """
    system = built(scene)
    if spin is None:
        model, where = linearize(system, equilibrium(system), held=True), ""
    else:
        turning = steady_spin(system, spin, rate)
        model, where = turning.linearize(), f", {spin} at {rate:g} rad/s, in the rotating frame"
    modes = model.modes
    if not 1 <= number <= len(modes):
        raise ValueError(f"there is no mode {number}: the scene has the modes 1 to {len(modes)}")
    mode = modes[number - 1]
    period = 1.0 / mode.frequency_hz if mode.frequency_hz > 0.0 else 1.0
    phases = np.linspace(0.0, 2.0 * np.pi, FRAMES)
    states = [model.displaced(mode, AMPLITUDE, phase) for phase in phases.tolist()]
    names, _ = system.state_names
    return scene_view(
        [system.scene] * FRAMES,
        states,
        [name for name, _ in names],
        f"mode {number}: {mode}{where}",
        times=period * phases / (2.0 * np.pi),
    )
