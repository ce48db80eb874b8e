"""The reference of a case with its error bars, and the distance of the rebuilt motion from it."""

from pathlib import Path

import numpy as np

from .case import read_case
from .forms import read_table


def distance(channel, a, b):
    """Distances (T,) of two rows of a channel: of orientations the angle between them."""
    if channel.endswith(".orientation"):
        apart = np.minimum(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))
        return 4.0 * np.arcsin(np.minimum(0.5 * apart, 1.0))
    return np.linalg.norm(a - b, axis=1)


def reference(folder):
    """Times, channels (T, k) by name, and the uncertainty of each, from the two tables of a case."""
    file, other = Path(folder) / "reference.csv", Path(folder) / "uncertainty.csv"
    bars = read_table(other, ("channel", "unit", "how"))
    if list(bars) != ["channel", "unit", "uncertainty", "range", "how"] or np.any(bars["uncertainty"] < 0.0):
        raise SystemExit(f"{other}: it has other columns than a table of error bars, or negative ones")
    units = dict(zip(bars["channel"], bars["unit"], strict=True))
    (time, times), *columns = read_table(file).items()
    if time != "t [s]" or times[0] != 0.0 or np.any(np.diff(times) <= 0.0):
        raise SystemExit(f"{file}: its first column is no time that begins at zero and grows")
    found = {channel: {} for channel in units}
    for column, values in columns:
        name, _, symbol = column.removesuffix("]").rpartition(" [")
        channel = name if name in units else name.rpartition(".")[0]
        if channel not in units or symbol != ("1" if channel.endswith(".orientation") else units[channel]):
            raise SystemExit(f'{file}: "{column}" is not the channel and unit of a row of {other.name}')
        found[channel][name.removeprefix(channel)] = values
    for channel, parts in found.items():
        if not parts or list(parts) != sorted(parts, key=lambda part: "wxyz".find(part[1:])):
            raise SystemExit(f'{file}: "{channel}" of {other.name} has no columns, or not in the order w, x, y, z')
    stored = {channel: np.column_stack(list(parts.values())) for channel, parts in found.items()}
    return times, stored, dict(zip(bars["channel"], bars["uncertainty"], strict=True))


def compare(folder, rtol=1e-13, method="DOP853", until=np.inf):
    """For each channel that is rebuilt: the largest distance to the reference up to a time, and its uncertainty."""
    case = read_case(folder)
    times, stored, known = reference(folder)
    here = times <= until
    times, stored = times[here], {name: values[here] for name, values in stored.items()}
    ours = case.channels(times, case.integrate(times, rtol, method))
    for name in stored.keys() & ours.keys():
        if stored[name].shape != ours[name].shape:
            raise SystemExit(f"{Path(folder) / 'reference.csv'}: \"{name}\" has {stored[name].shape[1]} columns")
    off = {name: distance(name, ours[name], stored[name]) for name in stored if name in ours}
    return {name: (float(np.max(values)), known[name]) for name, values in off.items()}
