"""The clauses of connectors hold for the adapters that have them, and each fails for an adapter with a fault."""

from collections.abc import Callable
from dataclasses import replace as moved
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from crosscheck.conformance.catalogue import CLAUSES
from crosscheck.conformance.connectors import CONNECTORS
from crosscheck.conformance.trial import try_clause
from crosscheck.engines import connections
from crosscheck.engines.connections import Along, Exerted
from crosscheck.engines.links import Attachment
from crosscheck.engines.registry import engine
from flexmb.scene.functions import Constant

NAMES = [clause.name for clause in CONNECTORS.clauses]


def given(**values: Any) -> Callable[[Callable], Callable]:
    """Laws made from a connector with other values."""
    return lambda law: lambda connector: law(replace(connector, **values))


def lossless(tension: Callable) -> Callable:
    def made(connector: Any) -> Callable:
        at = tension(connector)
        return lambda *motion: at(*motion)._replace(power=0.0)

    return made


def straight(law: Callable) -> Callable:
    """Straight lines between the samples of a table, beyond them its last loads."""
    return lambda places, loads: lambda x: (float(np.interp(x, places, loads)), 0.0)


def acting_on_a(load: Callable[[Exerted], Any]) -> Callable[[Callable], Callable]:
    def fault(exerts: Callable) -> Callable:
        def made(connector: Any) -> Callable:
            right = exerts(connector)

            def wrong(*motion: Any) -> Exerted:
                found = right(*motion)
                return found._replace(on_a=load(found))

            return wrong

        return made

    return fault


def driving(friction: Callable) -> Callable:
    return lambda stems, rate: Along(-friction(stems, rate).load, 0.0, 0.0)


FAULTS: dict[str, tuple[str, Callable[[Callable], Callable]]] = {
    "a-stretched-line-pulls": ("tension_of", given(stiffening=(4000.0, 300.0))),
    "a-damper-resists-the-rate-of-length": ("tension_of", given(damping_Ns_m=-5.0)),
    "an-actuator-pushes-its-ends-apart": ("tension_of", given(force_N=Constant(value=-3.0))),
    "a-slack-cable-does-nothing": ("tension_of", given(acts="both")),
    "a-buffer-pushes-alone": ("tension_of", given(acts="both")),
    "a-table-is-met-and-continued": ("_by_table", straight),
    "a-line-reacts-on-a": ("exerts", acting_on_a(lambda found: -0.9 * found.on_b)),
    "a-bushing-is-in-axes-of-a": ("closed_frames", lambda right: lambda *item: _unturned(*right(*item))),
    "a-bushing-derives-from-its-energy": ("_inverse_jacobian", lambda right: lambda turn: np.eye(3)),
    "a-bushing-reacts-on-a": ("exerts", acting_on_a(lambda found: -found.on_b)),
    "an-angular-spring-turns-back": ("_along", given(rest_rad=0.0)),
    "a-linear-spring-pulls-back": ("_along", given(damping_Ns_m=-2.0)),
    "a-stop-pushes-back": ("_along", given(stop_dissipation_s_rad=0.0)),
    "friction-acts-against-the-rate": ("_along", given(static_Nm=None)),
    "friction-of-a-wheel-reacts-on-its-body": ("_friction", driving),
    "connectors-balance-energy-and-work": ("tension_of", lossless),
}
"""The function of an adapter that is wrong, and what it is made of the right one."""


def _unturned(a: Attachment, b: Attachment) -> tuple[Attachment, Attachment]:
    """Frame A in the axes of its body."""
    return moved(a, frame=moved(a.frame, rotation=np.eye(3))), b


def test_every_clause_has_its_fault() -> None:
    assert set(FAULTS) == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_faulty_adapter_breaks_it(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pinocchio")
    sound = try_clause(engine("pinocchio"), CLAUSES[name])
    assert sound.status == "holds", sound.message
    part, fault = FAULTS[name]
    monkeypatch.setattr(connections, part, fault(getattr(connections, part)))
    found = try_clause(engine("pinocchio"), CLAUSES[name])
    assert found.status == "broken" and (" must be " in found.message or " is off by " in found.message), found.message
