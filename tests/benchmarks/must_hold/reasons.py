"""Why rows are missed: what a profile says, for readers of the page. What is met needs no reason and shows none."""

from __future__ import annotations

from typing import NamedTuple


class Reason(NamedTuple):
    """One text for rows that are missed for the same reason."""

    rows: tuple[str, ...]
    text: str


REASONS = (
    Reason(
        ("dop853_1e-06", "equal_error_cpp_1e-06"),
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
)
