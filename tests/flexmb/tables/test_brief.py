"""What results show at a prompt fits into a few lines."""

from __future__ import annotations

import dataclasses
import inspect

import numpy as np
import pytest

import flexmb as fm
from flexmb.tables.named import brief

LINES, WIDTH = 8, 100
PLAIN = {"FinalValue", "TimeIntegral"}  # of numbers and names alone


def _public() -> list[type]:
    named = {name: getattr(fm, name) for name in fm.__all__}
    return [each for name, each in named.items() if inspect.isclass(each) and dataclasses.is_dataclass(each)]


@pytest.mark.parametrize("kind", _public(), ids=lambda kind: kind.__name__)
def test_every_public_record_says_itself_how_it_is_shown(kind: type) -> None:
    """The representation that a dataclass is given prints all its arrays."""
    written_by = inspect.getsourcefile(kind.__repr__)
    assert written_by is not None
    assert (inspect.getsourcefile(dataclasses) == written_by) == (kind.__name__ in PLAIN)


def _swinging() -> fm.Scene:
    builder, parent = fm.SceneBuilder("chain", gravity=(0.0, 0.0, -9.81)), "ground"
    for i in range(12):
        builder.rigid_body(f"b{i}", mass=1.0, inertia=(0.01, 0.1, 0.1), com=(0.3, 0.0, 0.0))
        builder.revolute(f"h{i}", parent, f"b{i}", axis=(0, 1, 0), angle=0.1, stiffness=9.0, damping=1.0,
                         parent_position=(0.6, 0.0, 0.0))  # fmt: skip
        parent = f"b{i}"
    return builder.marker("tip", parent).scene()


def test_results_of_a_chain_are_shown_in_a_few_lines() -> None:
    scene = _swinging()
    system = fm.compile(scene)
    state = system.initial_state
    found = fm.sensitivities(scene, 0.1, ["b0.mass_kg"], ["tip.position.z"])
    data = {"t": found.t, "tip.position.z": found.values[:, 0]}
    results = [
        state, fm.equilibrium(scene), fm.linearize(scene), system.evaluate(0.0, state.q, state.u),
        system.acceleration_derivatives(state),
        fm.simulate_batch([scene, scene], 0.1), fm.fit(scene, data, ["b0.mass_kg"], sigma=1e-3),
        fm.uncertainty(scene, 0.1, {"b0.mass_kg": 0.1}, ["tip.position.z"]), fm.Misfit(data), *found.events,
        fm.simulate(scene, 0.1).envelope, fm.simulate(scene, 0.1).restart,
    ]  # fmt: skip
    for result in results:
        text = repr(result)
        assert text.lstrip("<").startswith(type(result).__name__)
        assert len(text) <= LINES * WIDTH and "\n" not in text, text


def test_small_things_are_shown_whole_and_large_ones_by_their_size() -> None:
    @dataclasses.dataclass
    class Some:
        row: np.ndarray
        table: dict[str, float]
        names: tuple[str, ...]
        text: str

        __repr__ = brief

    assert repr(Some(np.array([1.0, 2.5]), {}, ("a", "b"), "short")) == (
        "Some(row=[1.0, 2.5], table={}, names=('a', 'b'), text='short')"
    )
    assert repr(Some(np.zeros((3, 4), np.int64), {"k": 1.0}, ("x",) * 9, "y" * 80)) == (
        f"Some(row=<int64 3 x 4>, table=<1 by name>, names=<9 of str>, text='{'y' * 57}'...)"
    )


def test_numbers_have_six_digits_and_whole_ones_all() -> None:
    @dataclasses.dataclass
    class Some:
        row: np.ndarray

        __repr__ = brief

    assert repr(Some(np.array([1.0 / 3.0, 1e-20 / 3.0]))) == "Some(row=[0.333333, 3.33333e-21])"
    assert repr(Some(np.array([1j / 3.0, np.nan]))) == "Some(row=[0.333333j, (nan+0j)])"
    assert repr(Some(np.array([12345678]))) == "Some(row=[12345678])"
