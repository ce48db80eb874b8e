"""What is drawn of one run, as data: `flexmb.run.plots` writes it as pictures, `flexmb.view.charting` as a page.

Loads and momenta are drawn by components, with their signs. What is below the rounding of a channel's arithmetic
(`flexmb.run.rounding`) is drawn as zero, and what varies by less than that about another value as constant.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from flexmb.run.channels import channels_of, magnitude, signal_range
from flexmb.run.rounding import Floors
from flexmb.run.run_arrays import RunArrays
from flexmb.system.observables import open_components
from flexmb.typing import Real
from flexmb.view.charting import Charts, Curve, EventMark, Panel, RunChart

AXES = "xyz"
MOST = 10  # curves of a panel at first: as many as there are colours, and a longer legend would not fit
OFFERED = 50  # curves of a panel that a page may show: a browser takes seconds for hundreds
LOADS = ("load", "total_load", "wheel_load", "connector")


def charts_of(run: RunArrays) -> Charts:
    """The charts of a run: markers, energy, momentum, loads and drives, as far as it has them."""
    drawn = _Drawn(run)
    charts = [chart for chart in (drawn.markers(), drawn.energy(), drawn.momentum(), drawn.loads(), drawn.drives())]
    stopped = "" if run.finished else f": {run.message.split(':')[0]}"
    events = tuple(EventMark(event.name, event.t) for event in run.events)
    return Charts(f"{run.scene}{stopped}", run.t, tuple(chart for chart in charts if chart is not None), events)


class _Drawn:
    """The channels of a run without rounding."""

    def __init__(self, run: RunArrays) -> None:
        self._run, self._channels = run, channels_of(run)
        self._floors = Floors(self._channels, run.statistics.evaluations)

    def markers(self) -> RunChart | None:
        paths = {name: self._clean(f"marker:{name}.position") for name in self._run.markers}
        if not paths:
            return None
        far = {name: signal_range(".position", _finite(path)) for name, path in paths.items()}
        rows = [(_panel(f"{axis} (m)", paths, i, far),) for i, axis in enumerate(AXES)]
        return RunChart("markers", tuple(rows), _left_out(far, "those that move farthest"))

    def energy(self) -> RunChart:
        kinds = {kind: self._clean(f"energy.{kind}")[:, 0] for kind in self._run.energy}
        curves = [Curve(kind, energy) for kind, energy in kinds.items() if np.any(energy)]
        work = self._clean("work")[:, 0]
        curves += [Curve("work", work, "applied")] if np.any(work) else []
        curves.append(Curve("total", self._clean("energy.total")[:, 0], "sum"))
        drift = _without(self._run.energy_drift[:, None], self._floors.of("energy.total"))[:, 0]
        below = Panel("drift (J)", (Curve("total - start - work", drift),))
        return RunChart("energy", ((Panel("energy (J)", tuple(curves)),), (below,)))

    def momentum(self) -> RunChart:
        parts = {"angular (N m s)": "momentum.angular", "linear (N s)": "momentum.linear"}
        panels = [
            Panel(label, tuple(Curve(axis, values) for axis, values in zip(AXES, self._clean(name).T, strict=True)))
            for label, name in parts.items()
        ]
        return RunChart("momentum", tuple((panel,) for panel in panels))

    def loads(self) -> RunChart | None:
        found = dict(self._loads())
        if not found:
            return None
        torques, forces = ({name: both[i] for name, both in found.items()} for i in (0, 1))
        # A torque and a force are compared with the largest of their own.
        share = {name: 0.0 for name in found}
        for group in (torques, forces):
            sizes = {name: magnitude("", _finite(values)) for name, values in group.items()}
            most = max(sizes.values()) or 1.0
            share = {name: max(part, sizes[name] / most) for name, part in share.items()}
        rows = [
            (_panel(f"torque {axis} (N m)", torques, i, share), _panel(f"force {axis} (N)", forces, i, share))
            for i, axis in enumerate(AXES)
        ]
        unknown = open_components(self._run.undetermined)
        notes = [_left_out(share, "those with the largest loads"), f"not determined: {unknown}" if unknown else ""]
        return RunChart("loads", tuple(rows), "; ".join(filter(None, notes)))

    def drives(self) -> RunChart | None:
        curves = {}
        for name, drive in self._run.drives.items():
            for i, values in enumerate(self._clean(f"drive:{name}").T):
                curves[name if drive.shape[1] == 1 else f"{name}[{i}]"] = values[:, None]
        if not curves:
            return None
        sizes = {name: magnitude("", _finite(values)) for name, values in curves.items()}
        panel = _panel("drive load (N or N m)", curves, 0, sizes)
        return RunChart("drives", ((panel,),), _left_out(sizes, "those with the largest loads"))

    def _loads(self) -> Iterator[tuple[str, tuple[Real, Real]]]:
        """Torque and force (T,3) of every hinge, closure, sum, wheel and connector, by a name of its own."""
        told: set[str] = set()
        for channel in self._channels:
            kind, _, rest = channel.partition(":")
            if kind in LOADS and rest.endswith(".torque"):
                item = rest.removesuffix(".torque")
                name = item if item not in told else f"{kind}:{item}"
                told.add(item)
                yield name, (self._clean(channel), self._clean(f"{kind}:{item}.force"))

    def _clean(self, channel: str) -> Real:
        return _without(self._channels[channel], self._floors.of(channel))


def _without(values: Real, least: float) -> Real:
    """Values (T,k) without rounding: zero where they are within `least` of it, constant where they stay within that."""
    low, high = (reduce(values, axis=0) for reduce in (np.fmin.reduce, np.fmax.reduce))
    middle = 0.5 * low + 0.5 * high
    with np.errstate(invalid="ignore", over="ignore"):  # of diverging runs
        still = np.where((high - low <= 2.0 * least) & np.isfinite(values), middle, values)
        return np.where(np.abs(still) <= least, 0.0, still)


def _finite(values: Real) -> Real:
    """Values of which the size can be told: what is not determined, or has overflown, counts as zero."""
    return np.where(np.isfinite(values), values, 0.0)


def _panel(label: str, vectors: Mapping[str, Real], component: int, sizes: Mapping[str, float]) -> Panel:
    """The component of the largest vectors, in their order."""
    by_size = sorted(sizes, key=lambda name: -sizes[name])
    shown, offered = set(by_size[:MOST]), set(by_size[:OFFERED])
    own = {name: vector[:, component] for name, vector in vectors.items() if name in offered}
    return Panel(label, tuple(Curve(name, values, shown=name in shown) for name, values in own.items()))


def _left_out(sizes: Mapping[str, float], which: str) -> str:
    if len(sizes) <= MOST:
        return ""
    more = "" if len(sizes) <= OFFERED else f"; a page can show {OFFERED} of them, the CSV file has all"
    return f"{MOST} of {len(sizes)}: {which}{more}"
