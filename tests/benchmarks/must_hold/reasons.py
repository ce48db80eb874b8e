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
        "measurements of ten and 35 bodies lie on both sides of the goal, 2.45 to 2.6. Kernels of single axes take 4 % "
        "more time for them than special ones.",
    ),
    Reason(
        ("call_derivatives_chain",),
        "the evaluator that it is compared with became 1.3 times as fast by kernels of single axes; the call takes "
        "12.9 µs as before. Beside the kernel it checks its argument, copies three matrices, and makes its records.",
    ),
    Reason(
        ("dop853_1e-06", "equal_error_cpp_1e-06", "equal_error_cpp_1e-10"),
        "a run at 1e-7 (42 steps) takes 0.60 ms, and one of a microsecond 0.26 ms: `simulate` checks its arguments, "
        "starts a thread and observes two samples, where the rival is a bare call. At 1e-10 it counts less.",
    ),
    Reason(
        ("equal_error_scipy_1e-06", "equal_error_scipy_1e-10"),
        "the goal is that of SciPy's DOP853 at equal tolerance on another processor, where 77 to 80 % of the rival's "
        "time were SciPy's; on this one they are 58 %. The tuner takes LSODA, whose loop is compiled.",
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
        "kernels of single axes take 0.20 µs a copy, where those of all rigid trees took 0.23. Special ones met them "
        "on another processor, 22 and 17. What computes for ten seconds gets these by itself.",
    ),
    Reason(
        ("rk4",),
        "of 1000 steps each takes 3.2 µs, four evaluations by kernels of single axes; beside them a run takes 0.27 ms, "
        "and more where other work fills the cores: it waits for a thread of its own.",
    ),
    Reason(
        ("jacobian_5_modes", "jacobian_10_modes", "modes_ruthless_5", "exact_soromox"),
        "special kernels met their rows on another processor: 7.7 and 10.4 evaluations for the Jacobians, 5.3 for "
        "ruthless modes and 34 for the exact rod. By default, kinds of hinges, connectors and levels that a scene "
        "lacks are tested for in each body, and cost most where a body takes little (docs/kernels.md). What computes "
        "for ten seconds gets special kernels by itself.",
    ),
    Reason(
        ("sensitivity_1",),
        "a dual number holds seven derivatives: by one number the equations cost what they cost by seven, three times "
        "those of the motion (5.8 µs against 1.9), in as many steps (5730 against 5950: accuracy bounds both), beside "
        "the run itself. Other kernels of today are no cheaper: the whole Jacobian by recursion takes 9.2 µs, all "
        "outputs of a given motion in duals 7.1. Of the time beyond the run an eighth is Python. Narrower duals would "
        "be a second set of kernels; one pass for values and derivatives would take other steps than `simulate` does.",
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
