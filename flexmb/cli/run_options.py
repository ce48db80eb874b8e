"""The options of `flexmb simulate`, one type each: what typer reads, and `--help` shows."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, get_args

from typer import Option

from flexmb.integrate.integrator import Method

METHODS = ", ".join(f"`{name}`" for name in get_args(Method))

EndTime = Annotated[float, Option("--t-end", help="End of the run in s.", show_default=False)]
StartTime = Annotated[float | None, Option("--from-time", help="Start of the run in s; 0.", show_default=False)]
Samples = Annotated[int, Option(help="Output times, equally spaced, both ends included.")]

MethodName = Annotated[str, Option(help=f"{METHODS}: see docs/integrators.md. Methods of equal steps need `--step`.")]
Relative = Annotated[float, Option(help="Relative error allowed in a step.")]
Absolute = Annotated[float, Option(help="Absolute error allowed in a step, SI units.")]
Step = Annotated[float | None, Option(help="Step in s (rk4, generalised_alpha).", show_default=False)]
SpectralRadius = Annotated[
    float | None, Option(help="What generalised_alpha leaves of unresolved modes in a step; 0.8.", show_default=False)
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
    Path | None, Option(help="Go on from this `restart.npz` of another run, to the last bit.", show_default=False)
]

Folder = Annotated[Path, Option("--out", "-o", help="Folder for trajectory.csv and charts.")]
Also = Annotated[
    list[str] | None,
    Option(help="Besides the CSV: `npz`, `parquet`, or `rrd` for the viewer rerun; may be repeated."),
]
Plots = Annotated[bool, Option("--plots/--no-plots", help="Write charts beside the CSV.")]
Sections = Annotated[
    list[str] | None,
    Option(help="Loads across a beam's sections, to sections-BEAM.csv: `BEAM`, or `BEAM:x,x,...` in m."),
]
ErrorEstimate = Annotated[
    bool, Option("--error-estimate", help="Run again, tighter, and print the largest error of each channel.")
]
