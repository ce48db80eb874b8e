"""Reading somebody's CSV, and guessing what is wrong with it."""

import re
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crosscheck.engines.contract import Run
from crosscheck.library.find import load_case
from crosscheck.verify.against_case import verify_csv
from crosscheck.verify.causes import possible_causes
from crosscheck.verify.columns import VerifyError, read_columns
from crosscheck.verify.evidence import Evidence
from flexmb.typing import Real
from tests.crosscheck.fake_engines import TOLERANCES, Pendulum
from tests.crosscheck.sessions import CASE, PROVIDER, here

TIMES = np.linspace(0.0, 1.0, 5)
ALLOWED = 1e-6


def write(path: Path, text: str | bytes) -> Path:
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def table(head: str, *cells: str, times: Real = TIMES, separator: str = ",") -> str:
    return "\n".join([head, *(separator.join([repr(float(t)), *cells]) for t in times), ""])


TIP = "t,tip.px,tip.py,tip.pz"
GOOD = table(TIP, "1", "-.5e-3", "2.")
MILLI = [f"tip.position.{letter} [mm]" for letter in "xyz"]
BAD = {
    "empty": ("", "it is empty"),
    "only line ends": ("\n\n\n", "it is empty"),
    "header alone": (TIP + "\n", "only 0 rows"),
    "ragged": (GOOD.replace("0.5,1,", "0.5,", 1), "line 4 has 3 cells, the header has 4"),
    "decimal comma between commas": (GOOD.replace("0.5,1,", "0.5,1,5,", 1), "line 4 has 5 cells.*decimal comma"),
    "quoted decimal comma": (GOOD.replace("0.5,1,", '0.5,"1,5",', 1), "line 4.*'1,5' has a decimal comma"),
    "semicolons": (GOOD.replace(",", ";"), "line 1: columns are separated by semicolons.*decimal comma"),
    "tabs": (GOOD.replace(",", "\t"), "line 1: columns are separated by tabs"),
    "NaN": (GOOD.replace("0.5,1,", "0.5,nan,", 1), "line 4, column 'tip.px': 'nan' is not finite"),
    "infinity": (GOOD.replace("0.5,1,", "0.5,-Infinity,", 1), "line 4.*not finite"),
    "beyond double precision": (GOOD.replace("0.5,1,", "0.5,1e999,", 1), "line 4.*not finite"),
    "a word": (GOOD.replace("0.5,1,", "0.5,--,", 1), "line 4, column 'tip.px': '--' is not a number"),
    "underscores": (GOOD.replace("0.5,1,", "0.5,1_0,", 1), "is not a number"),
    "other digits": (GOOD.replace("0.5,1,", "0.5,\u0661,", 1), "is not a number"),
    "an empty cell": (GOOD.replace("0.5,1,", "0.5,,", 1), 'line 4: the cell of column "tip.px" is empty'),
    "a doubled column": (GOOD.replace("tip.py", "tip.px"), 'columns 2 and 3 are both called "tip.px"'),
    "a column without name": (GOOD.replace("tip.pz", ""), "column 4 has no name"),
    "a quote left open": (GOOD.replace("0.5,1,", '0.5,"1,', 1), "line .*correct the quotes"),
    "a huge cell": (GOOD.replace("0.5,1,", "0.5," + "1" * 200_000 + ",", 1), "line 4: field larger than"),
    "a time twice": (GOOD.replace("0.5,1", "0.25,1"), "in line 4 the time is 0.25 s, after 0.25 s: times must rise"),
    "times in another order": (GOOD.replace("0.75,1", "0.1,1"), "in line 5 the time is 0.1.* s, after 0.5 s"),
    "too many rows": (GOOD + "1.25,1,1,1\n" * 9, "in line 8 the time is 1.25 s, after 1.25 s"),
    "too few rows": (GOOD.rpartition("1.0,")[0], "only 4 rows"),
    "no time": (GOOD.replace("\n0.5,", "\n,"), "in line 4 the time is empty"),
    "another first column": (GOOD.replace("t,", "x,", 1), 'the first column must be "t"'),
    "not UTF-8": (GOOD.encode() + b"\xff", "line 7 is not UTF-8"),
    "UTF-16": (GOOD.encode("utf-16"), "line 1 is not UTF-8"),
    "NUL": (GOOD.replace("0.5,1,", "0.5,\0,", 1), "line 4"),
    "times alone": (table("t", times=TIMES), "nothing in it but times"),
    "half a group": (table("t,tip.px", "1"), "no whole group contains tip.px"),
    "another unit": (table("t [s]," + ",".join(MILLI), "1", "1", "1"), '"mm": give it in m'),
    "some units": (table("t [s],tip.px", "1"), "has no unit"),
    "nothing to compare": (table("t [s],pivot.angle [rad]", "1"), "no column of it can be compared"),
    "a million columns": ("t" + ",x" * 10**6 + "\n", 'both called "x"'),
    "a million empty columns": ("t" + "," * 10**6 + "\n", "only 0 rows"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=BAD)
def test_a_bad_csv_is_refused_with_its_line(tmp_path: Path, text: str | bytes, message: str) -> None:
    file = write(tmp_path / "my.csv", text)
    with pytest.raises(VerifyError, match=message) as refused:
        read_columns(file, TIMES)
    assert str(refused.value).startswith(str(file))
    assert len(str(refused.value)) < 800


@pytest.mark.parametrize("path", ["/dev/zero", "/proc", "missing.csv"])
def test_what_is_no_file_is_refused(path: str) -> None:
    with pytest.raises(VerifyError, match=re.escape(path)):
        read_columns(Path(path), TIMES)


@pytest.mark.parametrize("change", [
    lambda text: text, lambda text: "\ufeff" + text, lambda text: text.replace("\n", "\r\n"),
    lambda text: text.rstrip(), lambda text: text + "\n\n,,,\n", lambda text: text.replace(",", " , "),
    lambda text: "\n" + text, lambda text: text.replace("tip.px", '"tip.px"'),
], ids=["as it is", "byte order mark", "CRLF", "no end", "empty rows", "spaces", "empty line", "quotes"])  # fmt: skip
def test_a_good_csv_is_read(tmp_path: Path, change) -> None:
    columns = read_columns(write(tmp_path / "my.csv", change(GOOD)), TIMES)
    assert list(columns.channels) == ["marker:tip.position"]
    np.testing.assert_array_equal(columns.channels["marker:tip.position"], np.tile([1.0, -0.5e-3, 2.0], (5, 1)))


FLOATS = st.floats(allow_nan=False, allow_infinity=False)


@given(st.lists(st.lists(FLOATS, min_size=3, max_size=3), min_size=5, max_size=5))
def test_numbers_come_back_exactly(tmp_path_factory: pytest.TempPathFactory, rows: list[list[float]]) -> None:
    text = "\n".join([TIP, *(",".join([repr(float(t)), *map(repr, row)]) for t, row in zip(TIMES, rows, strict=True))])
    columns = read_columns(write(tmp_path_factory.getbasetemp() / "numbers.csv", text), TIMES)
    assert columns.channels["marker:tip.position"].tobytes() == np.array(rows).tobytes()


def test_flexmbs_own_trajectory_agrees(tmp_path: Path) -> None:
    """Every vector is found, coordinates and accelerations are left out and named."""
    import flexmb as fm

    case = load_case(CASE)
    run = fm.simulate(case.scene(case.run.variants[0]), 4.0, samples=81)
    run.to_csv(tmp_path / "trajectory.csv")
    checked = verify_csv(case, tmp_path / "trajectory.csv", engine="fine", provider=PROVIDER, scheduler=here)
    assert {verdict.status for verdict in checked.all} == {"agree"}, [verdict.reason for verdict in checked.all]
    assert {f"marker:tip.{part}" for part in ("position", "orientation", "velocity", "angular_velocity")} | {
        "load:pivot.force", "energy.total", "momentum.linear"
    } <= {verdict.channel for verdict in checked.all}  # fmt: skip
    assert any("acceleration" in name for name in checked.left_out)
    text = (tmp_path / "trajectory.csv").read_text(encoding="utf-8")
    letters = {"x": "y", "y": "x"}
    exchanged = re.sub(r"tip\.velocity\.([xy])", lambda found: f"tip.velocity.{letters[found[1]]}", text)
    wrong = write(tmp_path / "wrong.csv", exchanged)
    (differing,) = verify_csv(case, wrong, engine="fine", provider=PROVIDER, scheduler=here).unexpected
    assert differing.channel == "marker:tip.velocity"
    assert "worst at t = " in differing.reason
    assert "the components are in the order y, x, z?" in differing.reason


def likely_cause(channel: str, values: Real, reference: Real, others: dict[str, Real]) -> str:
    """All causes found, in words."""
    times = np.linspace(0.0, 3.0, len(values))
    return ", or ".join(possible_causes(Evidence(channel, values, times, {channel: reference, **others}, ALLOWED)))


def motion(seed: int = 0, samples: int = 60) -> tuple[Real, Real]:
    """A smooth vector (T,3) of size 1 and a smooth turning (T,4)."""
    random, t = np.random.default_rng(seed), np.linspace(0.0, 3.0, samples)
    waves = random.normal(size=(7, 3)) @ np.array([np.ones_like(t), np.sin(t), np.cos(1.7 * t)])
    orientation = waves[:4].T + np.array([3.0, 0, 0, 0])
    return waves[4:].T, orientation / np.linalg.norm(orientation, axis=1)[:, None]


def to_body(orientation: Real, vectors: Real) -> Real:
    w, x, y, z = orientation.T
    R = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    return np.einsum("ijt,ti->tj", R, vectors)


VECTOR = {
    "thousandths of the unit": lambda v, q: 1e3 * v,
    "thousands of the unit": lambda v, q: 1e-3 * v,
    "degrees instead of radians": lambda v, q: np.degrees(v),
    "pi/180 once too often": lambda v, q: np.radians(v),
    "of the wrong sign": lambda v, q: -v,
    "component y is of the wrong sign": lambda v, q: v * [1, -1, 1],
    "component z is 1000 times too large": lambda v, q: v * [1, 1, 1000],
    "in the axes of": lambda v, q: to_body(q, v),
    "a sample too late": lambda v, q: np.vstack([v[:1], v[:-1]]),
    "2 samples too early": lambda v, q: np.vstack([v[2:], v[-2:]]),
}
QUATERNION = {
    "quaternions are conjugate": lambda q: q * [1, -1, -1, -1],
    "scalar-last: the order": lambda q: np.roll(q, -1, axis=1),
    "scalar-last and conjugate": lambda q: np.roll(q * [1, -1, -1, -1], -1, axis=1),
}


CHANNELS = ("marker:m.velocity", "marker:m.angular_velocity", "load:h.force", "wheel_load:w.torque")


@pytest.mark.parametrize("channel", CHANNELS)
@pytest.mark.parametrize("cause", VECTOR)
def test_each_cause_is_guessed(channel: str, cause: str) -> None:
    true, orientation = motion()
    wrong = VECTOR[cause](true, orientation)
    noise = 1e-3 * ALLOWED * np.random.default_rng(3).normal(size=true.shape)
    wrong = wrong + noise * min(1.0, np.max(np.abs(wrong)) / 1e3)
    guess = likely_cause(channel, wrong, true, {"marker:m.orientation": orientation})
    assert cause in guess
    assert ("inboard body" in guess) == (cause == "of the wrong sign" and "load" in channel)


@pytest.mark.parametrize("order", [order for order in permutations(range(3)) if order != (0, 1, 2)])
def test_exchanged_components_are_named_in_the_order_given(order: tuple[int, ...]) -> None:
    true, _ = motion()
    assert likely_cause("load:h.force", true[:, order], true, {}) == (
        f"the components are in the order {', '.join('xyz'[i] for i in order)}"
    )


@pytest.mark.parametrize("cause", QUATERNION)
def test_each_convention_of_quaternions_is_guessed(cause: str) -> None:
    _, true = motion()
    assert cause in likely_cause("marker:m.orientation", -QUATERNION[cause](true), true, {})


def test_another_origin_is_guessed() -> None:
    true, _ = motion()
    guess = likely_cause("marker:m.position", true + [0.5, 0.0, -2.0], true, {})
    assert guess == "the origin is another one, off by (0.5, 0, -2) m"


@given(st.integers(0, 10**6), st.sampled_from(["marker:m.position", *CHANNELS, "marker:m.orientation"]))
def test_noise_and_other_motions_give_no_guess(seed: int, channel: str) -> None:
    """Nor does a factor that is none of those known, or any cause with an error on top of it."""
    (vector, orientation), random = motion(seed, 12), np.random.default_rng(seed + 1)
    true = orientation if channel.endswith("orientation") else vector
    noise, other = random.normal(size=true.shape), motion(seed + 1, 12)[channel.endswith("orientation")]
    markers = {} if channel.endswith("orientation") else {"marker:m.orientation": orientation}
    for wrong in (noise, other, 1e-3 * noise, true + 1e-3 * noise, 1e3 * (true + 1e-3 * noise)):
        assert likely_cause(channel, wrong, true, markers) == ""
    if not channel.endswith("orientation"):
        assert likely_cause(channel, 1.01 * true, true, markers) == ""


@given(st.integers(0, 10**6))
def test_a_reference_at_rest_gives_no_guess(seed: int) -> None:
    """Anything made a thousand times smaller would fit a reference that is zero within what is allowed."""
    random = np.random.default_rng(seed)
    still, noise = 0.1 * ALLOWED * random.normal(size=(9, 3)), 100.0 * ALLOWED * random.normal(size=(9, 3))
    assert likely_cause("load:h.force", noise, still, {}) == ""


def test_the_command_shows_a_table_with_the_cause(tmp_path: Path) -> None:
    case = load_case(CASE)
    times = np.linspace(0.0, 4.0, 81)
    run = Pendulum(case.scene(case.run.variants[0])).simulate(Run(times), TOLERANCES[3])
    columns = np.column_stack([times, 1e3 * run.markers["tip"].position, run.loads["pivot"][:, 3:]])
    head = ",".join(["t", *(f"tip.p{c}" for c in "xyz"), *(f"pivot.f{c}" for c in "xyz")])
    np.savetxt(tmp_path / "my.csv", columns, "%.17g", ",", header=head, comments="")
    checked = verify_csv(case, tmp_path / "my.csv", engine="fine", provider=PROVIDER, scheduler=here)
    assert "(mm, say)" in checked.details["marker:tip.position"].cause
    assert checked.details["load:pivot.force"].cause == ""
    assert 0.0 < checked.details["marker:tip.position"].worst_s <= 4.0


def test_an_engine_that_ends_its_process_is_no_reference(tmp_path: Path) -> None:
    """Such an engine ended the command with its own exit code, which can be 0."""
    case = load_case(CASE)
    csv = tmp_path / "my.csv"
    csv.write_text("t,tip.px,tip.py,tip.pz\n" + "".join(f"{t!r},0,0,0\n" for t in np.linspace(0.0, 4.0, 81).tolist()))
    with pytest.raises(VerifyError, match="crasher .* is not there: crashed"):
        verify_csv(case, csv, engine="crasher", provider=PROVIDER)


def test_the_engine_runs_where_the_scheduler_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []
    csv = tmp_path / "my.csv"
    csv.write_text("t,tip.px,tip.py,tip.pz\n" + "".join(f"{t!r},0,0,0\n" for t in np.linspace(0.0, 4.0, 81).tolist()))

    def nowhere(*given: object, scheduler: object, **others: object) -> None:
        seen.append(scheduler)
        raise VerifyError("stopped here")

    monkeypatch.setattr("crosscheck.verify.target.run_planned", nowhere)
    elsewhere = object()
    with pytest.raises(VerifyError, match="stopped here"):
        verify_csv(load_case(CASE), csv, engine="fine", provider=PROVIDER, scheduler=elsewhere)  # type: ignore[arg-type]
    assert seen == [elsewhere]
