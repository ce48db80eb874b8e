"""crosscheck-expect.toml and its options: what is read, to which cases it applies, what is refused and how."""

from pathlib import Path

import pytest

from crosscheck.library.case_error import CaseError
from crosscheck.library.claims import Claims, claims_on
from crosscheck.library.efforts import continued, with_extra
from crosscheck.library.expect_file import ExpectFile, efforts_option, goal_option, read_expect_file

FILE = """
[[goal]]
engine = "mine"
cases = ["pendulums/*", "!double"]
goals = { "*" = 1e-3, load = 1e-2 }
reason = "first order"

[[expected_failure]]
engine = "mine"
cases = ["wheeled"]
channels = ["load:rotor"]
status = "differ"
reason = "issue 12"

[[efforts]]
engine = "mine"
values = [1e-4, 5e-5]
"""
TAGS = {"pendulums/double": ("chaotic",), "pendulums/plain": (), "tops/heavy": ("wheeled",), "own/case": ()}


def read(folder: Path, text: str) -> ExpectFile:
    file = folder / "crosscheck-expect.toml"
    file.write_text(text, encoding="utf-8")
    return read_expect_file(file)


def on(content: ExpectFile, *session: str) -> dict[str, Claims]:
    return claims_on(session or tuple(TAGS), {"f": content}, names=tuple(TAGS), tags=lambda: TAGS, engines=("mine",))


def test_entries_apply_to_the_cases_that_they_mean(tmp_path: Path) -> None:
    claims = on(read(tmp_path, FILE))
    assert [name for name in TAGS if claims[name].goals] == ["pendulums/plain"]
    assert [name for name in TAGS if claims[name].failures] == ["tops/heavy"]
    assert all(claims[name].efforts_of("mine") == (1e-4, 5e-5) for name in TAGS)
    (goals,) = claims["pendulums/plain"].goals
    assert goals.place == "f: $.goal[0]" and goals.whole
    assert claims["tops/heavy"].of(["other"]) == Claims()


def test_whole_are_entries_all_of_whose_cases_are_in_the_session(tmp_path: Path) -> None:
    claims = on(read(tmp_path, FILE), "pendulums/plain")["pendulums/plain"]
    assert claims.goals[0].whole and not claims.efforts[0].whole


def test_options_say_the_same(tmp_path: Path) -> None:
    assert goal_option("mine=1e-3").goals[0].goals == {"*": 1e-3}
    assert goal_option("mine:load:elbow.torque=1e-2").goals[0].goals == {"load:elbow.torque": 1e-2}
    assert efforts_option("mine=1e-4,5e-5").efforts == read(tmp_path, FILE).efforts


@pytest.mark.parametrize(
    ("option", "text", "message"),
    [
        (goal_option, "1e-3", "write ENGINE=NUMBER"),
        (goal_option, "mine=", "behind the = must be numbers"),
        (goal_option, "=1", "write ENGINE=NUMBER"),
        (efforts_option, "mine", "write ENGINE=NUMBER,NUMBER"),
        (efforts_option, "mine=1,", "behind the = must be numbers"),
    ],
)
def test_options_that_say_nothing_are_refused(option, text: str, message: str) -> None:
    with pytest.raises(CaseError, match=message):
        option(text)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('mine"\ncases = ["pend', 'mien"\ncases = ["pend', '$.goal[0].engine: there is no engine "mien"'),
        ("1e-3", "nan", "$.goal[0].goals.*: nan is no part of the range"),
        ("1e-3", "-1e-3", "$.goal[0].goals.*: -0.001 is no part of the range"),
        ("1e-3", "2.0", "$.goal[0].goals.*: 2 is no part of the range"),
        ('{ "*" = 1e-3, load = 1e-2 }', "{}", "$.goal[0].goals: it names no channel"),
        ("load = 1e-2", "lode = 1e-2", '"lode" can name no channel'),
        ('reason = "first order"', 'reason = " "', "$.goal[0].reason: it is empty"),
        ('reason = "issue 12"\n', "", "reason"),
        ('["pendulums/*", "!double"]', '["pendulum/*"]', "$.goal[0].cases: \"pendulum/*\" is a pattern"),
        ('["pendulums/*", "!double"]', "[]", "$.goal[0].cases: it means no case"),
        ('["wheeled"]', '["weeled"]', '$.expected_failure[0].cases: "weeled" is no case'),
        ('["load:rotor"]', "[]", "$.expected_failure[0].channels: it names no channel"),
        ('["load:rotor"]', '["load:rotor.tork"]', 'there is no "tork" of a load'),
        ('"differ"', '"crashed"', "status"),
        ("5e-5", "inf", "$.efforts[0].values: inf makes no sense"),
        ("5e-5", "nan", "$.efforts[0].values: nan makes no sense"),
        ("[1e-4, 5e-5]", "[]", "$.efforts[0].values: 0 efforts"),
        ("values =", "value =", "value"),
        ("[[goal]]", "[[goals]]", "goals"),
        ("[[goal]]", "[[goal]", "line 2"),
    ],
)
def test_what_is_wrong_is_named_with_its_place(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in FILE
    with pytest.raises(CaseError) as caught:
        on(read(tmp_path, FILE.replace(old, new)))
    assert message in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(CaseError, match=r"none\.toml"):
        read_expect_file(tmp_path / "none.toml")


def test_all_problems_are_told_at_once(tmp_path: Path) -> None:
    with pytest.raises(CaseError) as caught:
        on(read(tmp_path, FILE.replace("1e-3", "nan").replace("issue 12", "")))
    assert str(caught.value).count("f: $.") == 2


def test_efforts_take_their_places_in_a_ladder() -> None:
    assert with_extra((0.1, 0.05), (0.025, 0.07)) == (0.1, 0.07, 0.05, 0.025)
    assert with_extra((0.1, 0.05), (0.05,)) == (0.1, 0.05)
    assert continued("step", (0.1, 0.05), 2) == (0.025, 0.0125)
    assert continued("tolerance", (1e-8, 1e-10), 3) == (1e-12, 1e-13), "none below the tightest that means anything"
    assert continued("tolerance", (1e-12, 1e-14), 2) == ()
    assert continued("step", (0.1,), 1) == (0.05,) and continued("step", (), 1) == ()
