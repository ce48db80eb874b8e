"""Functions of time as jets: value, rate and acceleration at one time, from their definitions in the schema."""

from __future__ import annotations

from typing import assert_never

import numpy as np
from numpy.polynomial import Polynomial

from flexmb.dense.jets import Jet, chain, constant, polynomial
from flexmb.scene.functions import Constant, ControlSignal, Function, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table

SEPTIC = Polynomial([0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0])


def profile(function: Function, t: float) -> Jet:
    """The function and its first two derivatives at time t, scalars."""
    time = Jet(np.array(t), np.array(1.0), np.array(0.0))
    match function:
        case Constant(value=value):
            return constant(value)
        case Ramp(value=value, rate=rate, start_s=start):
            return polynomial(Polynomial([value - rate * start, rate]), time)
        case Sine(amplitude=a, angular_frequency_rad_s=w, phase_rad=phase, offset=offset):
            s, c = np.sin(w * t + phase), np.cos(w * t + phase)
            return constant(offset) + chain(a * s, a * w * c, -a * w**2 * s, time)
        case SmoothStep(start_value=a, end_value=b, start_s=start, duration_s=duration):
            if not start < t < start + duration:
                return constant(a if t <= start else b)
            x = polynomial(Polynomial([-start / duration, 1.0 / duration]), time)
            return polynomial(a + (b - a) * SEPTIC, x)
        case SpinUp(rate=rate, duration_s=duration):
            if t >= duration:
                return polynomial(Polynomial([-0.5 * rate * duration, rate]), time)
            k = 2.0 * np.pi / duration
            swing = chain(np.cos(k * t) / k**2, -np.sin(k * t) / k, -np.cos(k * t), time)
            growth = polynomial(Polynomial([-1.0 / k**2, 0.0, 0.5]), time)
            return (growth + swing).map(lambda x: rate / duration * x)
        case Pulse(value=value, start_s=start, duration_s=duration):
            return constant(value if start <= t < start + duration else 0.0)
        case ControlSignal():
            return constant(0.0)  # a single evaluation has no controllers
        case Table(times_s=times, values=values):
            from scipy.interpolate import make_interp_spline  # slow to import, and few scenes have tables

            spline = make_interp_spline(times, values, k=5)
            return Jet(spline(t), spline(t, 1), spline(t, 2))
        case _:
            assert_never(function)
