"""Names of open components: what is written is read again, and what cannot be a component is refused."""

import numpy as np
import pytest

from crosscheck.engines.openness import ALL, NOTHING_OPEN, Openness

FORCE, TORQUE, DRIVE = "load:pin.force", "load:pin.torque", "drive:arm"


@pytest.mark.parametrize(
    ("names", "read"),
    [
        ((FORCE,), {FORCE: ALL}),
        ((f"{FORCE}[all]",), {FORCE: ALL}),
        ((f"{FORCE}[y, z]",), {FORCE: {1, 2}}),
        ((f"{FORCE}[z,y]", f"{TORQUE}[x]"), {FORCE: {1, 2}, TORQUE: {0}}),
        ((f"{FORCE}[z]", f"{FORCE}[y]"), {FORCE: {1, 2}}),
        ((f"{FORCE}[z]", f"{FORCE}[x, y]"), {FORCE: ALL}),
        ((f"{DRIVE}[2]", f"{DRIVE}[10]"), {DRIVE: {1, 9}}),
        (("drive:arm[1][all]",), {"drive:arm[1]": ALL}),
        (("load:odd [x].force",), {"load:odd [x].force": ALL}),
    ],
)
def test_names_are_read_and_written(names, read):
    found = Openness.of(names)
    assert found.by_channel == read
    assert Openness.of(found.names) == found and list(found.names) == sorted(found.names)


@pytest.mark.parametrize("name", [f"{FORCE}[1]", f"{DRIVE}[x]", f"{DRIVE}[1, y]", f"{FORCE}[x, ]"])
def test_a_component_that_a_channel_cannot_have_is_refused(name):
    with pytest.raises(ValueError, match="the components of"):
        Openness.of((name,))


def test_flags_and_whole_channels():
    found = Openness.of_flags([(FORCE, np.array([False, True, False])), (TORQUE, np.ones(3, bool)),
                               ("drive:free", np.zeros(2, bool))])  # fmt: skip
    assert found.names == (f"{FORCE}[y]", TORQUE)
    assert found.flags(FORCE, 3).tolist() == [False, True, False] and found.flags("energy.kinetic", 1).tolist() == [0]
    assert (found.is_whole(TORQUE), found.is_whole(FORCE, 3), found.is_whole("work")) == (True, False, False)
    assert Openness.of((f"{DRIVE}[1]", f"{DRIVE}[2]")).is_whole(DRIVE, 2)
    assert (found.components(FORCE), found.components(TORQUE)) == ("y", "all")


def test_what_is_beyond_another():
    some, more = Openness.of((f"{FORCE}[y]", DRIVE)), Openness.of((f"{FORCE}[y, z]", TORQUE, DRIVE))
    assert some.beyond(more) == NOTHING_OPEN
    assert more.beyond(some).names == (f"{FORCE}[z]", TORQUE)
    assert Openness.of((FORCE,)).beyond(some).names == (f"{FORCE}[x, z]",)
    assert Openness.of((DRIVE,)).beyond(Openness.of((f"{DRIVE}[1]",))).names == (DRIVE,)
    assert (some | more).names == more.names


def test_only_open_components_are_filled():
    rows = np.arange(6.0).reshape(2, 3)
    found = Openness.of((f"{FORCE}[x]",))
    assert found.filled(TORQUE, rows, np.nan) is rows
    assert found.filled(FORCE, rows, 0.0).tolist() == [[0.0, 1.0, 2.0], [0.0, 4.0, 5.0]]
