"""The reference of a case with its error bars, and the distance of the rebuilt motion from it."""

import csv
from pathlib import Path

import numpy as np

from .case import read_case


def distance(channel, a, b):
    """Distances (T,) of two rows of a channel: of orientations the angle between them."""
    if channel.endswith(".orientation"):
        apart = np.minimum(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))
        return 4.0 * np.arcsin(np.minimum(0.5 * apart, 1.0))
    return np.linalg.norm(a - b, axis=1)


def reference(folder):
    """Times, channels (T, k) by name, and the uncertainty of each, from the two tables of a case."""
    with open(Path(folder) / "reference.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    values, places = np.array(rows[1:], float), {}
    with open(Path(folder) / "uncertainty.csv", encoding="utf-8", newline="") as file:
        known = {row["channel"]: float(row["uncertainty"]) for row in csv.DictReader(file)}
    for column, name in enumerate(rows[0][1:], start=1):
        name = name.rpartition(" [")[0]
        places.setdefault(name if name in known else name.rpartition(".")[0], []).append(column)
    return values[:, 0], {name: values[:, columns] for name, columns in places.items()}, known


def compare(folder, rtol=1e-13, method="DOP853", until=np.inf):
    """For each channel that is rebuilt: the largest distance to the reference up to a time, and its uncertainty."""
    case = read_case(folder)
    times, stored, known = reference(folder)
    here = times <= until
    times, stored = times[here], {name: values[here] for name, values in stored.items()}
    ours = case.channels(times, case.integrate(times, rtol, method))
    off = {name: distance(name, ours[name], stored[name]) for name in stored if name in ours}
    return {name: (float(np.max(values)), known[name]) for name, values in off.items()}
