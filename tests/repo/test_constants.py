"""Numbers in the pages that are also constants of the code: constants.toml lists the sentences, and both must agree."""

import re
import tomllib
from importlib.util import find_spec
from typing import Any

import pytest

from tests.repo.project import ROOT

NUMBER = r"(2\^-?\d+|\d+(?:,\d{3})+|\d+(?:\.\d+)?(?:e-?\d+)?)"
LISTED = tomllib.loads((ROOT / "tests" / "repo" / "constants.toml").read_text(encoding="utf-8"))["number"]


def said(text: str, sentence: str) -> list[float]:
    """The numbers that a text has in place of each {} of a sentence, which it must contain once."""
    pattern = NUMBER.join(re.escape(part) for part in _one_line(sentence).split("{}"))
    found = list(re.finditer(rf"(?<![\w.^]){pattern}", _one_line(text)))
    assert len(found) == 1, f"{len(found)} times on the page: {sentence}"
    return [_value(number) for number in found[0].groups()]


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _value(number: str) -> float:
    return 2.0 ** int(number[2:]) if number.startswith("2^") else float(number.replace(",", ""))


def constant(place: str) -> float:
    """The value of module:NAME; of the adapter to a peer that is not installed the test is skipped."""
    module, name = place.split(":")
    assert find_spec(module), f"there is no module {module}"
    return float(getattr(pytest.importorskip(module, exc_type=ModuleNotFoundError), name))


@pytest.mark.parametrize("listed", LISTED, ids=lambda each: f"{each['page']}: {each['is'][0].rpartition(':')[2]}")
def test_pages_say_what_the_code_does(listed: dict[str, Any]) -> None:
    """The page has the sentence, with the values that the constants have today."""
    text = (ROOT / "docs" / listed["page"]).read_text(encoding="utf-8")
    assert said(text, listed["says"]) == [constant(place) for place in listed["is"]]


def test_another_number_is_noticed() -> None:
    """Negative controls: another value, a sentence that is not there, and one that is there twice."""
    sentence = "less than {} of it"
    assert said("It is less than\n2^-50 of it.", sentence) == [2.0**-50] != [2.0**-51]
    assert said("less than 1,000,000 of it", sentence) == [1e6]
    for text in ("nothing of the kind", "less than 2 of it and less than 2 of it"):
        with pytest.raises(AssertionError, match="times on the page"):
            said(text, sentence)
