"""Text that readers must not take long over."""

from __future__ import annotations

import pytest

from flexmb.scene.reading import DEEPEST, Unreadable, parse_toml


@pytest.mark.parametrize("long", ["1" * 4_000_000, "a " * 2_000_000, "a" + " " * 4_000_000, "a.b " * 1_000_000])
def test_long_text_is_read_in_one_go(long: str) -> None:
    """A search for dotted keys that took the square of a word's length hung for minutes."""
    assert parse_toml(f'x = "{long}"') == {"x": long}


@pytest.mark.parametrize("dot", [".", " . "])
def test_endless_keys_are_refused(dot: str) -> None:
    assert parse_toml(dot.join("a" * DEEPEST) + " = 1")
    with pytest.raises(Unreadable, match="a key has more than 64 parts"):
        parse_toml(dot.join("a" * (DEEPEST + 1)) + " = 1")
