"""Samples and their statistics against what is known of the distributions."""

import math

import numpy as np
import pytest

from crosscheck.library.case import CaseError
from crosscheck.sampling.file import LogNormal, Normal, SweepFile, SweptQuantity, Triangular, Uniform, Values
from crosscheck.sampling.outputs import summarise
from crosscheck.sampling.run import Sampled
from crosscheck.sampling.sample import SampleRecord, reduce
from crosscheck.sampling.values import sample_values, with_values
from flexmb import SceneBuilder
from flexmb.scene.shapes import beam_section

QUANTITY = SweptQuantity(name="x", channel="marker:tip.position", value="final")
ALL = (
    Uniform(path="a", low=-1.0, high=3.0), Normal(path="b", mean=2.0, sd=0.5),
    LogNormal(path="c", median=2.0, sigma=0.25), Triangular(path="d", low=0.0, mode=1.0, high=4.0),
    Values(path="e", values=(1.0, 2.0, 6.0)),
)  # fmt: skip
MEANS = (1.0, 2.0, 2.0 * math.exp(0.25**2 / 2), 5.0 / 3.0, 3.0)


def sweep(number: int | None, sampling: str = "random", parameters: tuple = ALL, seed: int = 5) -> SweepFile:
    return SweepFile(
        title="s", scene="s.toml", engines=("fine",), parameters=parameters, quantities=(QUANTITY,), number=number,
        sampling=sampling, seed=seed,
    )  # fmt: skip


@pytest.mark.parametrize("sampling", ["random", "latin_hypercube"])
def test_samples_have_the_means_of_their_distributions(sampling: str) -> None:
    values = sample_values(sweep(4000, sampling))
    errors = values.std(axis=0) / math.sqrt(len(values))
    assert (np.abs(values.mean(axis=0) - MEANS) < 4 * errors).all()
    assert np.isfinite(values).all()


def test_random_samples_are_those_of_their_number_and_seed() -> None:
    few, many, other = (sample_values(sweep(n, seed=seed)) for n, seed in ((5, 1), (50, 1), (5, 2)))
    assert np.array_equal(few, many[:5])
    assert not np.isin(few[:, :4], other[:, :4]).any()


def test_a_latin_hypercube_has_one_sample_in_each_part_of_each_axis() -> None:
    axes = (Uniform(path="a", low=0.0, high=1.0), Uniform(path="b", low=0.0, high=1.0))
    values = sample_values(sweep(50, "latin_hypercube", axes))
    for column in values.T:
        assert sorted((column * 50).astype(int)) == list(range(50))
    assert abs(np.corrcoef(values.T)[0, 1]) < 0.5


def test_a_grid_has_every_combination() -> None:
    axes = (Values(path="a", values=(1.0, 2.0)), Values(path="b", values=(5.0, 6.0, 7.0)))
    assert sample_values(sweep(None, "grid", axes)).tolist() == [[a, b] for a in (1.0, 2.0) for b in (5.0, 6.0, 7.0)]


def sampled(values: np.ndarray) -> Sampled:
    records = tuple(
        SampleRecord(sample=n, engine="fine", scene="", asked="", status="finished", parameters={},
                     quantities={"x": float(value)})
        for n, value in enumerate(values)
    )  # fmt: skip
    return Sampled(sweep(len(values)), records)


def test_standard_errors_are_those_of_repeated_sweeps() -> None:
    """What mean, sd and quantiles scatter by over 400 sweeps of 200 samples, against the errors that each states."""
    generator = np.random.default_rng(0)
    found = [summarise(sampled(generator.gamma(3.0, size=200))).distributions[0] for _ in range(400)]
    for estimates in (
        [each.mean for each in found],
        [each.sd for each in found],
        *([each.quantiles[p] for each in found] for p in ("0.05", "0.5", "0.95")),
    ):
        scatter = np.std([estimate.value for estimate in estimates])
        assert np.mean([estimate.standard_error for estimate in estimates]) == pytest.approx(scatter, rel=0.15)


def test_few_samples_have_no_errors_that_they_cannot_have() -> None:
    (one,) = summarise(sampled(np.array([2.0]))).distributions
    assert one.mean.standard_error is None and one.sd is None and one.quantiles["0.5"].standard_error is None
    (equal,) = summarise(sampled(np.full(9, 3.0))).distributions
    assert (equal.sd.value, equal.sd.standard_error, equal.mean.standard_error) == (0.0, 0.0, 0.0)


def test_nothing_finished_is_not_green() -> None:
    blank = sampled(np.array([1.0])).records[0]
    lost = SampleRecord(**{**{f: getattr(blank, f) for f in blank.__struct_fields__}, "status": "failed"})
    assert not summarise(Sampled(sweep(1), (lost,))).ok


def test_quantities_of_a_signal() -> None:
    channels = {"marker:tip.position": np.array([[3.0, 0.0, 4.0], [0.0, -7.0, 1.0], [0.0, 2.0, 0.0]])}

    def value(what: str, component: int | str | None) -> float:
        return reduce(SweptQuantity(name="x", channel="marker:tip.position", value=what, component=component), channels)

    assert [value("initial", None), value("final", None)] == [5.0, 2.0]
    assert [value(what, "y") for what in ("minimum", "maximum", "range", "largest")] == [-7.0, 2.0, 9.0, 7.0]
    assert value("mean", 2) == pytest.approx(5.0 / 3.0)
    for bad in ("w", 3, -1, "px"):
        with pytest.raises(ValueError, match="has 3 components"):
            value("final", bad)
    channels["marker:tip.position"][2] = math.nan
    with pytest.raises(ValueError, match="x is nan"):
        value("final", None)
    with pytest.raises(ValueError, match="gives no channel"):
        reduce(QUANTITY, {})


def test_paths_reach_every_station_and_whole_numbers_stay_whole() -> None:
    section = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700)
    scene = (
        SceneBuilder("s", gravity=(0, 0, -9.81))
        .beam("rod", length=1.0, elements=8, section=section, modes=4)
        .revolute("pivot", "ground", "rod", axis=(0, 1, 0))
        .scene()
    )
    stiffness = Uniform(path="bodies.rod.stations.*.EIy_Nm2", relative=True, low=0.0, high=2.0)
    elements = Values(path="bodies.rod.elements", values=(4.0, 4.5))
    both = sweep(None, parameters=(stiffness, elements))
    changed = with_values(scene, both, (1.5, 4.0))
    assert [station.EIy_Nm2 for station in changed.bodies[0].stations] == [
        1.5 * station.EIy_Nm2 for station in scene.bodies[0].stations
    ]
    assert changed.bodies[0].elements == 4 and isinstance(changed.bodies[0].elements, int)
    with pytest.raises(CaseError, match=r"4.5 is not a whole number"):
        with_values(scene, both, (1.0, 4.5))
