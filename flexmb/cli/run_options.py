"""The options of `flexmb simulate`, one type for each."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, get_args

from typer import Option

from flexmb.integrate.integrator import Method

METHODS = ", ".join(f"`{name}`" for name in get_args(Method))

EndTime = Annotated[float, Option("--t-end", help="End of the run in s.", show_default=False)]
StartTime = Annotated[float | None, Option("--from-time", help="Start of the run in s; default 0.", show_default=False)]
Samples = Annotated[int, Option(help="Output times, equally spaced, both ends included.")]

MethodName = Annotated[str, Option(help=f"{METHODS}: see docs/integrators.md. Fixed-step methods need `--step`.")]
Relative = Annotated[float, Option(help="Relative tolerance for the error of a step.")]
Absolute = Annotated[float, Option(help="Absolute tolerance for the error of a step, SI units.")]
Step = Annotated[float | None, Option(help="Step in s (rk4, generalised_alpha).", show_default=False)]
SpectralRadius = Annotated[
    float | None, Option(help="Spectral radius of generalised_alpha; default 0.8.", show_default=False)
]
AlgorithmName = Annotated[
    str,
    Option(
        help="`articulated` (recursion), `composite` (mass matrix), `frisch` (nested bodies, 1975) or "
        "`frisch_as_printed`."
    ),
]

Values = Annotated[
    list[str] | None,
    Option("--set", help="A value in the scene, `rod.mass_kg=2.0`; may be repeated.", show_default=False),
]
RestartFile = Annotated[
    Path | None, Option(help="Resume from `restart.npz` of another run, bit-identically.", show_default=False)
]

Folder = Annotated[Path, Option("--out", "-o", help="Folder for trajectory.csv and charts.")]
Also = Annotated[
    list[str] | None,
    Option(help="In addition to the CSV: `npz`, `parquet`, or `rrd` for the viewer rerun; may be repeated."),
]
Envelope = Annotated[
    bool,
    Option(
        "--envelope",
        help="Follow the run again over all of its steps; print the peaks of loads, write envelope.csv.",
    ),
]
Plots = Annotated[bool, Option("--plots/--no-plots", help="Write charts beside the CSV.")]
Sections = Annotated[
    list[str] | None,
    Option(help="Loads across a beam's sections, to sections-BEAM.csv: `BEAM`, or `BEAM:x,x,...` in m."),
]
ErrorEstimate = Annotated[
    bool, Option("--error-estimate", help="Run again with tighter tolerances; print each channel's largest error.")
]
