"""Case folders: the documented example is valid, faulty run files are refused with place and remedy."""

import re
import textwrap
import tomllib
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from crosscheck.library import case as case_module
from crosscheck.library.case import (
    CaseError,
    Comparison,
    ComparisonSide,
    Conservation,
    OpenChannels,
    Refined,
    RunFile,
    Variant,
)  # fmt: skip
from crosscheck.library.check import check_run_file
from crosscheck.library.find import Case, load_case, resolve, shipped_cases
from crosscheck.library.selection import select
from crosscheck.running.plan import refine, variant_scene
from tests.crosscheck.sessions import CASE, copy_case
from tests.flexmb.surrogate.beams import beam_scene

EXAMPLE = textwrap.dedent(case_module.__doc__.split("run.toml::")[1].split("Channels are named")[0])


def example() -> RunFile:
    return msgspec.convert(tomllib.loads(EXAMPLE), RunFile)


def test_the_documented_example_is_valid() -> None:
    check_run_file(example())


def test_missing_scene_and_unknown_case_say_what_to_do(tmp_path: Path) -> None:
    folder = copy_case(tmp_path)
    (folder / "scene.toml").unlink()
    with pytest.raises(CaseError, match=r"needs scene.toml"):
        load_case(folder)
    with pytest.raises(CaseError, match="crosscheck list"):
        resolve(("no such case",))


def test_a_folder_is_a_case() -> None:
    (case,) = resolve((str(CASE),))
    assert case.name == "pendulum/single"
    assert case.provenance is not None


def pairs(run: RunFile) -> set[tuple[str, str]]:
    return {(item.a.engine, item.b.engine) for item in run.comparisons}


def test_all_pairs_and_selections_of_engines() -> None:
    run = example()
    everything = pairs(select(run, ()))
    assert ("mujoco", "exudyn") in everything
    assert len(select(run, ()).comparisons) == 6 + 2
    assert pairs(select(run, ("native", "mujoco"))) == {("native", "mujoco")}
    alone = select(run, ("mujoco",))
    assert pairs(alone) == {pair for pair in everything if "mujoco" in pair}
    assert set(alone.variant("rigid").engines) == {"native", "pinocchio", "mujoco", "exudyn"}


def test_a_foreign_engine_joins_what_is_compared_engine_by_engine() -> None:
    run = select(example(), ("mine",))
    assert ("native", "mine") in pairs(run)
    assert all("mine" in pair for pair in pairs(run))


def listing(**changes: object) -> RunFile:
    """The example, whose engines are compared in momentum and energy by a comparison that lists two of them."""
    listed = Comparison(
        name="listed", variant="rigid", engines=("native", "pinocchio"), goals={"momentum": 1e-7, "energy.total": 1e-9},
        scales={"momentum.linear": 1.0, "energy.total": 2.0},
    )  # fmt: skip
    everyone = next(comparison for comparison in example().comparisons if comparison.variant == "rigid")
    everyone = msgspec.structs.replace(everyone, goals={"energy": 1e-9})
    run = msgspec.structs.replace(example(), comparisons=(everyone, msgspec.structs.replace(listed, **changes)))
    check_run_file(run)
    return run


def test_a_foreign_engine_joins_listed_engines_in_what_is_open_to_it_nowhere_else() -> None:
    found = [
        comparison for comparison in select(listing(), ("mine", "yours")).comparisons if comparison.name == "listed"
    ]
    assert {(each.a.engine, each.b.engine) for each in found} == {("mine", "yours")}
    found = [comparison for comparison in select(listing(), ("mine",)).comparisons if comparison.name == "listed"]
    assert {(each.a.engine, each.b.engine) for each in found} == {("native", "mine"), ("pinocchio", "mine")}
    assert {tuple(each.goals) for each in found} == {("momentum",)}
    assert {tuple(each.scales) for each in found} == {("momentum.linear",)}
    own = [comparison for comparison in select(listing(), ()).comparisons if comparison.name == "listed"]
    assert [(each.a.engine, each.b.engine, len(each.goals)) for each in own] == [("native", "pinocchio", 2)]


def test_a_foreign_engine_joins_a_variant_of_which_only_listed_engines_are_compared() -> None:
    run = msgspec.structs.replace(listing(), comparisons=listing().comparisons[1:])
    (one, other) = select(run, ("mine",)).comparisons
    assert set(one.goals) == set(other.goals) == {"momentum", "energy.total"}
    assert "mine" in select(run, ("mine",)).variant("rigid").engines


def test_a_foreign_engine_is_not_expected_to_differ_as_listed_ones_are() -> None:
    run = listing(expect="refused", because="no momentum", reason="they have none")
    assert not [comparison for comparison in select(run, ("mine",)).comparisons if comparison.name == "listed"]


def conserving(**changes: object) -> Conservation:
    return Conservation(**{"variant": "rigid", "quantity": "energy", "limit": 1e-9, "engines": ("native",)} | changes)


@pytest.mark.parametrize(
    "item, engines",
    [
        (conserving(), ("native", "mine")),
        (conserving(engines=()), ("native", "pinocchio", "mujoco", "exudyn", "mine")),
        (conserving(expect="differ", band=(1e-8, 1e-7), reason="it is lost"), ("native",)),
    ],
)
def test_a_foreign_engine_joins_those_that_a_conserved_quantity_lists(item: Conservation, engines: tuple[str]) -> None:
    run = msgspec.structs.replace(example(), conservations=(item,))
    check_run_file(run)
    (found,) = select(run, (*example().variant("rigid").engines, "mine")).conservations
    assert found.engines == engines
    (alone,) = select(run, ("mine",)).conservations if "mine" in engines else ((),)
    assert alone == () or alone.engines == ("mine",)
    assert select(run, ()).conservations[0].engines == tuple(engine for engine in engines if engine != "mine")


@pytest.mark.parametrize(
    "changes, text",
    [
        ({"channels": ()}, "name at least one channel"),
        ({"channels": ("markr",)}, '"markr" can name no channel'),
        ({"variants": ("rigd",)}, 'did you mean "rigid"'),
        ({"engines": ("natve",)}, 'did you mean "native"'),
        ({"engines": ("native", "native")}, "listed twice"),
        ({"reason": " "}, "give the reason"),
    ],
)
def test_what_a_case_leaves_open_is_checked_with_its_place(changes: dict[str, object], text: str) -> None:
    item = OpenChannels(**{"channels": ("momentum",), "variants": ("rigid",), "reason": "it is zero"} | changes)
    check_run_file(msgspec.structs.replace(example(), open=(OpenChannels(channels=("work",), reason="it is zero"),)))
    with pytest.raises(CaseError, match=re.escape(text)) as error:
        check_run_file(msgspec.structs.replace(example(), open=(item,)))
    assert "$.open[0]" in str(error.value)


def left_out(engine: str, variants: tuple[str, ...]) -> RunFile:
    """The example without an engine in some of its variants."""
    return msgspec.structs.replace(
        example(),
        variants=tuple(
            msgspec.structs.replace(v, engines=tuple(e for e in v.engines if e != engine)) if v.name in variants else v
            for v in example().variants
        ),
    )


def test_a_shipped_engine_that_the_case_does_not_name_joins_like_a_foreign_one() -> None:
    nowhere = left_out("exudyn", tuple(variant.name for variant in example().variants))
    assert ("native", "exudyn") in pairs(select(nowhere, ("native", "exudyn")))
    assert not any("exudyn" in pair for pair in pairs(select(nowhere, ()))), "only when it is asked for"


def test_a_shipped_engine_stays_out_of_a_variant_where_the_case_names_it_elsewhere() -> None:
    """`native-frisch` runs beside variant "full" of the example, so that it joins nothing of variant "rigid"."""
    assert "native-frisch" in example().variant("full").also
    chosen = select(example(), ("native-frisch",)).variants
    assert not any("native-frisch" in variant.engines for variant in chosen if variant.name == "rigid")


def test_charts_follow_their_variants() -> None:
    run = select(example(), ("exudyn",))
    assert [chart.variants for chart in run.charts] == [("rigid",)]


def uncharted(cases: Iterable[Case]) -> set[str]:
    """Cases without a chart, though a variant of theirs is about a run."""
    return {case.name for case in cases if not case.run.charts and not all(v.asks for v in case.run.variants)}


def test_every_case_of_a_run_has_a_chart_of_speed_against_accuracy() -> None:
    """Cases that are about the linearised motion alone have none: docs/timing.md says why."""
    assert not uncharted(shipped_cases())
    assert any(not case.run.charts for case in shipped_cases())
    bare = [replace(case, run=msgspec.structs.replace(case.run, charts=())) for case in shipped_cases()]
    assert {"manipulators/six_axis_arm", "chains/hundred_rods", "chains/thousand_rods"} <= uncharted(bare)


def test_an_engine_beside_a_variant_runs_it_without_joining_its_pairs() -> None:
    """Not as the first of all pairs, but where asked for, charted, and where a comparison names it."""
    variants = tuple(
        msgspec.structs.replace(v, engines=("native", "mujoco"), also=("exudyn",)) if v.name == "rigid" else v
        for v in example().variants
    )
    named = Comparison(
        name="named", goals={"energy": 1e-9},
        a=ComparisonSide(variant="rigid", engine="native"), b=ComparisonSide(variant="rigid", engine="exudyn"),
    )  # fmt: skip
    run = msgspec.structs.replace(example(), variants=variants, comparisons=example().comparisons[:1], controls=())
    chosen = select(run, ())
    assert pairs(chosen) == {("native", "mujoco")}
    assert chosen.variant("rigid").engines == ("native", "mujoco", "exudyn")
    assert chosen.variant("rigid").also == ()
    run = msgspec.structs.replace(run, comparisons=(*run.comparisons, named))
    check_run_file(run)
    assert pairs(select(run, ())) == {("native", "mujoco"), ("native", "exudyn")}


def test_a_variant_of_pieces_is_refined_by_more_pieces() -> None:
    scene = beam_scene()
    variant = Variant(
        name="pieces", transform="substructures", pieces=2, eigenmodes=1, refined=Refined(pieces=3), level="linear",
        engines=("native",),
    )  # fmt: skip
    coarse, fine = (variant_scene(scene, each) for each in (variant, refine(variant, variant.refined)))
    assert [body.name for body in coarse.bodies] == ["boom.p00", "boom.p01", "panel"]
    assert [body.name for body in fine.bodies] == ["boom.p00", "boom.p01", "boom.p02", "panel"]
    assert fine.bodies[0].level == "linear"
    assert [body.modes.count for body in coarse.bodies[:2]] == [1, 1]
    elsewhere = msgspec.structs.replace(variant, split_body="panel")
    with pytest.raises(ValueError, match="not a beam"):
        variant_scene(scene, elsewhere)
