"""All channels of a run of any engine: the motion and its loads, and where they were asked for derivatives."""

from __future__ import annotations

from crosscheck.engines.contract import Trajectory
from crosscheck.engines.linear.parts import FREQUENCIES
from flexmb.run.channels import channels_of
from flexmb.typing import Real

KNOWN_TO = "known_to"


def signals_of(run: Trajectory) -> dict[str, Real]:
    """Every channel (T, k) of a run: those of `channels_of`, then those of the linearised motion.

    Matrices are row by row. The channels "known_to.<name>" say how well the engine knows the derivatives and the
    frequencies of its own states; nothing compares them.
    """
    signals = channels_of(run)
    signals |= {f"derivatives.{name}": values for name, values in run.derivatives.items()}
    if run.frequencies is not None:
        signals[FREQUENCIES] = run.frequencies
    signals |= {f"{KNOWN_TO}.{name}": values[:, None] for name, values in run.known_to.items()}
    return signals
