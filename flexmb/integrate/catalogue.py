"""All integrators, each declared in its own file."""

from __future__ import annotations

from flexmb.integrate import dop853, exponential, generalised_alpha, radau5, rk4
from flexmb.integrate.integrator import Integrator
from flexmb.tables import arguments

INTEGRATORS: dict[str, Integrator] = {
    module.INTEGRATOR.name: module.INTEGRATOR for module in (dop853, rk4, radau5, exponential, generalised_alpha)
}
"""All integrators by name."""


def integrator(name: str) -> Integrator:
    """The integrator with this name; ValueError for an unknown name."""
    try:
        return INTEGRATORS[name]
    except (KeyError, TypeError):
        return INTEGRATORS[arguments.one_of("method", name, INTEGRATORS)]  # says which there are
