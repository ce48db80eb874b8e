"""Functions of time: value, rate and acceleration, and where they are not smooth."""

import numpy as np
from scipy.interpolate import make_interp_spline


def function_of(data):
    """Value, rate and acceleration of a function of time."""
    if data is None:
        return lambda t: (0.0, 0.0, 0.0)
    kind = data["kind"]
    if kind == "constant":
        return lambda t: (data["value"], 0.0, 0.0)
    if kind == "ramp":
        value, rate, start = data["value"], data["rate"], data["start_s"]
        return lambda t: (value + rate * (t - start), rate, 0.0)
    if kind == "sine":
        A, w, phase, offset = (data[k] for k in ("amplitude", "angular_frequency_rad_s", "phase_rad", "offset"))
        return lambda t: (
            offset + A * np.sin(w * t + phase),
            A * w * np.cos(w * t + phase),
            -A * w * w * np.sin(w * t + phase),
        )
    if kind == "smooth_step":
        first, height = data["start_value"], data["end_value"] - data["start_value"]
        start, T = data["start_s"], data["duration_s"]

        def step(t):
            x = min(max((t - start) / T, 0.0), 1.0)
            return (
                first + height * x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3),
                height / T * 140.0 * x**3 * (1.0 - x) ** 3,
                height / T**2 * 420.0 * x**2 * (1.0 - x) ** 2 * (1.0 - 2.0 * x),
            )

        return step
    if kind == "spin_up":
        rate, T = data["rate"], data["duration_s"]
        c = 2.0 * np.pi / T
        return lambda t: (
            (rate * (t - T / 2.0), rate, 0.0)
            if t >= T
            else (
                rate / T * (t * t / 2.0 + (np.cos(c * t) - 1.0) / c**2),
                rate / T * (t - np.sin(c * t) / c),
                rate / T * (1.0 - np.cos(c * t)),
            )
        )
    if kind == "pulse":
        start, end = data["start_s"], data["start_s"] + data["duration_s"]
        return lambda t: (data["value"] if start <= t < end else 0.0, 0.0, 0.0)
    if kind == "table":
        spline = make_interp_spline(data["times_s"], data["values"], k=5)
        first, second = spline.derivative(1), spline.derivative(2)
        return lambda t: (float(spline(t)), float(first(t)), float(second(t)))
    raise SystemExit(f'a function of time of kind "{kind}" is not rebuilt here')


def breaks_of(item):
    """Times at which functions of time inside the data are not smooth."""
    breaks = set()
    if isinstance(item, dict):
        if item.get("kind") in ("smooth_step", "pulse"):
            breaks |= {item["start_s"], item["start_s"] + item["duration_s"]}
        if item.get("kind") == "spin_up":
            breaks.add(item["duration_s"])
        item = list(item.values())
    if isinstance(item, list):
        for element in item:
            breaks |= breaks_of(element)
    return breaks
