"""Why rows are missed: what a profile says, for readers of the page. What is met needs no reason and shows none."""

from __future__ import annotations

from typing import NamedTuple


class Reason(NamedTuple):
    """One text for rows that are missed for the same reason."""

    rows: tuple[str, ...]
    text: str


REASONS = (
    Reason(
        ("implicit_four_bar",),
        "of 11 ms, 1872 evaluations of 2.2 µs take 4.1 and 157 Jacobians of 8 µs 1.3, 178 factorisations and the "
        "solutions 1.6; the rest is projection on the closure, settling and the call. Jacobians by dual numbers, of 33 "
        "µs, are a third of the rival's 15 ms: were they free, the ratio would be 1.6. Newton's method takes three "
        "iterations a step; a looser end of it saves a sixth of the evaluations, but costs a factor of four in error.",
    ),
    Reason(
        ("derivatives_10", "derivatives_35", "derivatives_100"),
        "measurements of ten and 35 bodies lie on both sides of the goal, 2.35 to 2.6. Kernels of single axes take 4 % "
        "more time for them than special ones. Ten bodies take 32 thousand operations, 14 in a nanosecond, a sixth of "
        "what the vector units complete: columns of one to ten bodies fill them in part.",
    ),
    Reason(
        ("call_derivatives_chain",),
        "beside the kernel it checks its argument, copies three matrices, and makes its records.",
    ),
    Reason(
        ("dop853_1e-06", "equal_error_cpp_1e-06", "equal_error_cpp_1e-10"),
        "of 0.48 ms at a tolerance of 1e-6, 414 evaluations take 0.30, the sums of the stages 0.03, and Python 0.15, "
        "where the rival is a bare call: 176 calls of functions, which check arguments, observe two samples and make "
        "records. Without them the ratio would be 4. Twelve measurements of the row of C++ at 1e-6, beside other work, "
        "gave 2.1 to 3.0, their median 2.6. An evaluation is six thousand operations, 8.4 in a nanosecond, "
        "where the processor completes 10 that are not vectors.",
    ),
    Reason(
        ("equal_error_scipy_1e-06", "equal_error_scipy_1e-10"),
        "the goal is that of SciPy's DOP853 at equal tolerance on another processor, where 77 to 80 % of the rival's "
        "time were SciPy's; on this one they are 58 to 66 %. The tuner takes LSODA, whose loop is compiled. Of a run "
        "at 1e-6 a third is Python, at 1e-10 a seventh; without it the ratios would be 9 and 8.4.",
    ),
    Reason(
        ("ffrf_boom_0.01", "ffrf_boom_0.001"),
        "16 and 12.9 while Exudyn's Newton method ran to 1e-8, on another processor. The tuner looks for the loosest "
        "tolerance that keeps the error, and found 1e-5 and 1e-6.",
    ),
    Reason(
        ("canonical_cold", "canonical"),
        "nothing is compiled. Of some 165 s of processor time the runs of peers take about 90 (Exudyn half of it), "
        "those of Frisch's algorithm 21, of the recursion 17, all inside kernels; judging and the report 13, planning "
        "and the starts of workers the rest. Two processors are busy for nine tenths of the time.",
    ),
    Reason(
        ("cases_worst",),
        "a beam that is bent by its length is integrated for 8.6 s; no kernel is compiled in any case.",
    ),
    Reason(
        ("batch_flexible",),
        "one copy alone became faster by more than eight at once. Sums over modes and their elimination fill "
        "vector instructions in both now: alone by eight modes of a body, in lanes by eight bodies. A sample in "
        "lanes takes 0.92 µs (1.10 before), one copy 2.9 (3.5). Lanes still pay for tables padded from five modes "
        "to eight, and 4 % for the copying of states.",
    ),
    Reason(
        ("modes_full_5", "modes_full_10", "modes_full_20"),
        "the articulated route is a hundredth to a sixth short, as runs of this row differ (10 modes 6.1 to 7.0, "
        "20 modes 12.6 to 15.3). Of some 0.8 µs a body with ten modes integrals and bias take a third, the "
        "elimination of modes another (each pivot waits for a vector that was just stored), the motion of ports a "
        "tenth.",
    ),
    Reason(
        ("growth_chain_1000_100000", "growth_star_1000_100000", "growth_binary_tree_1000_100000"),
        "memory. Three passes read and write 1.4 kB of constants and states a body, 3 kB in all: a thousand bodies "
        "lie in the cache, a hundred thousand stream from memory, which at its 12 GB/s takes 250 ns. Records asked "
        "for ahead of their turn hide a part. The faster the kernel, the larger the ratio.",
    ),
    Reason(
        ("kernel_10", "kernel_50", "kernel_100"),
        "measurements of ten bodies lie on both sides of the goal, 2.8 to 3.1. Kernels of single axes take 5 to 8 % "
        "more time than special ones, which met it on another processor: 3.6 to 3.7.",
    ),
    Reason(
        ("batch_aba", "batch_parallel"),
        "operations. A copy takes six thousand, in 0.155 µs at best: 39 in a nanosecond, where two vector units do "
        "41 that are not sums of products (82 with these, measured by a product of matrices). What computes for ten "
        "seconds gets special kernels by itself, which have fewer: 22 and 17 on another processor.",
    ),
    Reason(
        ("rk4",),
        "of 3.3 ms, 4000 evaluations by kernels of single axes take 2.9, the sums of the stages 0.25, and Python 0.15. "
        "With evaluations alone the ratio would be 2.75: they complete 8.4 operations in a nanosecond, where the "
        "processor completes 10 that are not vectors.",
    ),
    Reason(
        ("jacobian_5_modes", "jacobian_10_modes", "modes_ruthless_5", "exact_soromox"),
        "special kernels met their rows on another processor: 7.7 and 10.4 evaluations for the Jacobians, 5.3 for "
        "ruthless modes and 34 for the exact rod. By default, kinds of hinges, connectors and levels that a scene "
        "lacks are tested for in each body, and cost most where a body takes little (docs/kernels.md). What computes "
        "for ten seconds gets special kernels by itself.",
    ),
    Reason(
        ("fit_boom",),
        "runs of this scene take a millisecond, so that Python decides. Of the time of a fit a quarter builds nine "
        "systems of changed numbers, a fifth checks five scenes, a third makes five runs and their derivatives.",
    ),
    Reason(
        ("sensitivity_1",),
        "operations. An evaluation of the motion takes 9.2 thousand (1.6 µs). With derivatives each product becomes "
        "two, which makes 14 thousand instructions, whether they hold one derivative or seven: at least 2.8 µs, as the "
        "processor completes 5.1 in a nanosecond (measured by a product of matrices), and 4.9 in fact, as tables and "
        "workspace grow from 27 to 366 kB, beyond the first cache. In as many steps as the run's (72 thousand "
        "evaluations against 75: accuracy bounds both) the least is 0.20 s, beside 0.155 s for the run and 0.05 s for "
        "checks, tables and outputs, over 0.165 s: 2.5 runs. Only steps other than those of `simulate`, for values and "
        "derivatives in one pass, would come below.",
    ),
    Reason(
        ("ffrf_beam_0.01", "ffrf_beam_0.001", "ffrf_beam_0.0001"),
        "13.8, 32 and 61 by special kernels on another processor, before runs looked at every step for turns beyond "
        "their level and for what is left out: in a run of 2 ms that look takes about as long as its steps.",
    ),
    Reason(
        ("exact_coarse",),
        "40 steps take 4 ms; the rest is the watch of the stretch that is held, which forms the loads in sections of "
        "four beams in three states each in Python, from tables that are kept.",
    ),
    Reason(
        ("readme_warm",),
        "0.8 s on another processor. Python's imports, of which numba's are half, and of NumPy and SciPy, take it; no "
        "kernel is compiled.",
    ),
)
