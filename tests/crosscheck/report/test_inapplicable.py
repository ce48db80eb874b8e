"""An engine that joins a case and refuses it: what pages and files say, from the run to the report."""

from pathlib import Path

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.library.find import load_case
from crosscheck.report import write_all
from crosscheck.sealed.seal import read_results
from tests.crosscheck.sessions import copy_case, sweep_here

WHY = "revolute hinges are beyond it"


def session(folder: Path, asked: tuple[str, ...], recipe: str = "") -> SessionOutcome:
    case = copy_case(folder)
    with (case / "run.toml").open("a", encoding="utf-8") as file:
        file.write(recipe)
    sweep_here([load_case(case)], asked, folder / "records.jsonl")
    return write_all(folder / "records.jsonl", folder)[0]


def test_a_guest_that_refuses_is_on_the_pages_and_in_the_files(tmp_path: Path) -> None:
    outcome = session(tmp_path, ("fine", "stepper", "refuser"))
    assert outcome.uncompared == ["refuser"]  # in this session; one more case that it can do would make it green
    assert not outcome.unexpected and {verdict.engine_a for verdict in outcome.all} <= {"fine", "stepper"}
    index = (tmp_path / "report" / "index.html").read_text(encoding="utf-8")
    assert "<b>1</b> not applicable" in index and WHY in index and 'scope="col">refuser</th>' in index
    (page,) = (tmp_path / "report").glob("*/*.html")
    assert WHY in page.read_text(encoding="utf-8")
    case = read_results(tmp_path / "results.json").cases["pendulum/single"]
    assert case.not_applicable == {"rigid | refuser": WHY}


def test_without_a_guest_nothing_is_said_of_what_is_not_applicable(tmp_path: Path) -> None:
    assert session(tmp_path, ()).ok
    assert "not applicable</li>" not in (tmp_path / "report" / "index.html").read_text(encoding="utf-8")
    assert b"not_applicable" not in (tmp_path / "results.json").read_bytes()


def test_a_recipe_without_reference_is_on_the_pages_and_in_the_files(tmp_path: Path) -> None:
    routes = "".join(f'[[reference.route]]\nengine = "{engine}"\n' for engine in ("fine", "stepper"))
    recipe = f'\n[reference]\nvariant = "rigid"\n{routes}'
    assert session(tmp_path, (), recipe).unreferenced == ("pendulum/single",)
    index = (tmp_path / "report" / "index.html").read_text(encoding="utf-8")
    assert "<code>crosscheck regenerate pendulum/single</code>" in index
    assert read_results(tmp_path / "results.json").cases["pendulum/single"].unreferenced
