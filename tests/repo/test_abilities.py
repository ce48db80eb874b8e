"""What can be asked of which scene: the page says what comes of trying."""

from __future__ import annotations

from itertools import islice, product

import pytest

import flexmb as fm
from tests.repo import abilities


def row(ability: str) -> dict[str, str]:
    """The cells of the page by kinds of scenes, with reasons in place of their numbers."""
    lines = abilities.PAGE.read_text(encoding="utf-8").splitlines()
    reasons = {line.partition(". ")[0]: line.partition(". ")[2] for line in lines if line[:1].isdigit()}
    [line] = [line for line in lines if line.startswith(f"| {ability} |")]
    cells = [cell.strip() for cell in line.split("|")[2:-1]]
    return {kind: reasons.get(cell, cell) for kind, cell in zip(abilities.kinds(), cells, strict=True)}


SOME = list(islice(product(abilities.ABILITIES, abilities.kinds()), 0, None, len(abilities.kinds()) + 1))


@pytest.mark.parametrize(("ability", "kind"), SOME)
def test_the_page_says_what_comes_of_it(ability: str, kind: str) -> None:
    assert row(ability)[kind] == abilities.plain(abilities.tried(ability, kind))


@pytest.mark.slow
def test_the_page_is_what_comes_of_trying_all() -> None:
    assert abilities.PAGE.read_text(encoding="utf-8") == abilities.page(), f"run `python -m {abilities.__name__}`"


def test_what_is_refused_otherwise_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Negative control."""

    def refused(_: abilities.Kind) -> object:
        raise NotImplementedError("not here: take another")

    monkeypatch.setitem(abilities.ABILITIES, "`linearize`", refused)
    assert row("`linearize`")["rigid"] != abilities.tried("`linearize`", "rigid") == "not here: take another"


@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")  # of the runs with other numbers
@pytest.mark.parametrize("name", abilities.kinds())
def test_derivatives_that_are_given_are_right(name: str) -> None:
    """Forwards and backwards, against differences of runs."""
    kind, runs = abilities.kinds()[name], {"rtol": 1e-11, "atol": 1e-13}
    [mass] = [body.mass_kg for body in kind.scene.bodies if kind.number == f"{body.name}.mass_kg"]

    def end(value: float) -> float:
        run = fm.simulate(kind.scene.with_values({kind.number: value}), kind.t_end, samples=3, **runs)
        return float(run.markers["asked"].position[-1, 0])

    step = 1e-3 * mass
    true = (end(mass + step) - end(mass - step)) / (2.0 * step)
    close = 1e-5 * abs(true) + 1e-10
    if row("`sensitivities`")[name] == abilities.YES:
        found = fm.sensitivities(kind.scene, kind.t_end, [kind.number], [abilities.OUTPUT], samples=3, **runs)
        assert abs(found.derivatives[-1, 0, 0] - true) <= close
    if row("`gradient`")[name] == abilities.YES:
        found = fm.gradient(kind.scene, kind.t_end, [kind.number], fm.FinalValue(abilities.OUTPUT), **runs)
        assert abs(found.derivatives[0] - true) <= close
