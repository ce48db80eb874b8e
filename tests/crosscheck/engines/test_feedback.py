"""Scenes with controllers: engines that know of none are never asked about them."""

from __future__ import annotations

import pytest

import flexmb as fm
from crosscheck.engines.answers import support_of
from crosscheck.engines.contract import Support
from crosscheck.engines.functions_of_time import profile
from crosscheck.engines.native import NativeEngine, radau5
from tests.flexmb.control.scenes import rotor
from tests.flexmb.control.test_attitude import craft

LAW = fm.StateSpace(name="law", inputs=("angle",), D=((-1.0,),))


class Willing:
    """An engine that would take any scene."""

    name = "willing"

    def supports(self, scene: fm.Scene) -> Support:
        return Support("exact")


def test_an_engine_without_controllers_refuses_them() -> None:
    refused = support_of(Willing(), rotor(LAW))  # type: ignore[arg-type]
    assert refused.kind == "no"
    assert '"law": the adapter of engine willing knows no controllers' in refused.reason
    assert support_of(Willing(), rotor()).kind == "exact"  # type: ignore[arg-type]


def test_the_native_engine_runs_them() -> None:
    assert support_of(NativeEngine(), rotor(LAW)).kind == "exact"


def test_implicit_methods_take_continuous_ones() -> None:
    assert support_of(radau5(), rotor(LAW)).kind == "exact"


def test_a_signal_is_no_profile() -> None:
    with pytest.raises(NotImplementedError, match="no function of time"):
        profile(fm.ControlSignal(source="law"))


def test_laws_whose_changes_no_record_would_see_are_refused() -> None:
    law = fm.UserLaw(
        name="law", inputs=("angle",), function="tests.flexmb.control.laws:proportional", parameters=(1.0,)
    )
    assert "would not know its changes" in support_of(NativeEngine(), rotor(law)).reason
    assert support_of(NativeEngine(), craft().scene()).kind == "exact"
