"""Scenes with controllers: engines that know of none are never asked about them."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb as fm
from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import Run, Support
from crosscheck.engines.functions_of_time import profile
from crosscheck.engines.native import NativeEngine, radau5
from crosscheck.engines.registry import engine
from tests.flexmb.control.scenes import rotor
from tests.flexmb.control.test_attitude import craft
from tests.flexmb.control.test_closed_chains import GRASHOF, LAGGING, controlled

LAW = fm.StateSpace(name="law", inputs=("angle",), D=((-1.0,),))


class Willing:
    """An engine that would take any scene."""

    name = "willing"

    def supports(self, scene: fm.Scene) -> Support:
        return Support("exact")


def test_an_engine_without_controllers_refuses_them() -> None:
    refused = CheckedEngine(Willing()).supports(rotor(LAW))  # type: ignore[arg-type]
    assert refused.kind == "no"
    assert '"law": the adapter of engine willing knows no controllers' in refused.reason
    assert CheckedEngine(Willing()).supports(rotor()).kind == "exact"  # type: ignore[arg-type]


def test_the_native_engine_runs_them() -> None:
    assert CheckedEngine(NativeEngine()).supports(rotor(LAW)).kind == "exact"


def test_implicit_methods_take_continuous_ones() -> None:
    assert CheckedEngine(radau5()).supports(rotor(LAW)).kind == "exact"


@pytest.mark.parametrize("name", ["native-radau5", "native-exponential", "native-generalised-alpha"])
def test_and_those_of_closed_chains(name: str) -> None:
    """They run as by the engine without Jacobians."""
    scene, run = controlled(GRASHOF, "drive", LAGGING), Run(np.linspace(0.0, 0.1, 3))
    assert CheckedEngine(engine(name)).supports(scene).kind == "exact"
    done, exact = (
        engine(each).compile(scene).simulate(run, engine(each).efforts(scene)[-1]) for each in (name, "native")
    )
    assert done.status == exact.status == "finished"
    apart = np.abs(done.markers["joint"].position - exact.markers["joint"].position).max()
    assert apart < (1e-4 if "alpha" in name else 1e-9)


def test_a_signal_is_no_profile() -> None:
    with pytest.raises(NotImplementedError, match="no function of time"):
        profile(fm.ControlSignal(source="law"))


def test_laws_whose_changes_no_record_would_see_are_refused() -> None:
    law = fm.UserLaw(
        name="law", inputs=("angle",), function="tests.flexmb.control.laws:proportional", parameters=(1.0,)
    )
    assert "would not know its changes" in CheckedEngine(NativeEngine()).supports(rotor(law)).reason
    assert CheckedEngine(NativeEngine()).supports(craft().scene()).kind == "exact"
