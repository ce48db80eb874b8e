"""No channel of a case is silent: each is judged, or the case says why not. By the run files alone: no engine runs."""

from dataclasses import replace

import msgspec
import pytest

from crosscheck.library.case import OpenChannels
from crosscheck.library.find import load_case, shipped_folder, shipped_names
from tests.cases.declared import idle, left

MADE_OF_ALL = "closed_chains/andrews", "connectors/one_at_a_time", "spinning_beam/beam_s_supercritical"


@pytest.mark.parametrize("name", shipped_names())
def test_every_channel_that_an_engine_may_offer_is_judged_or_left_open_with_a_reason(name: str) -> None:
    case = load_case(shipped_folder() / name)
    silent = sorted({f"{each.variant}, {each.engine}: {each.channel}" for each in left(case) if not each.open})
    assert not silent, "give it a goal, or name it in [[open]] of run.toml with the reason"
    assert idle(case) == [], "it names nothing that is left: take it out"


@pytest.mark.parametrize("name", MADE_OF_ALL)
def test_a_channel_that_loses_its_goal_or_its_reason_is_noticed(name: str) -> None:
    case = load_case(shipped_folder() / name)
    assert any(each.said for each in left(case))
    unsaid = replace(case, run=msgspec.structs.replace(case.run, open=()))
    assert not any(each.said for each in left(unsaid)) and not all(each.open for each in left(unsaid))
    without = replace(case, run=msgspec.structs.replace(case.run, comparisons=(), conservations=(), reference=None))
    assert {each.channel for each in left(without) if not each.open}
    more = OpenChannels(channels=("marker:nowhere",), reason="made up")
    assert idle(replace(case, run=msgspec.structs.replace(case.run, open=(*case.run.open, more))))
