"""The command `crosscheck`, one file a command: it reads the command line and shows what the other rooms do.

What a command does is imported when it runs: `--help`, completion and a mistyped word load neither cases nor NumPy.
"""

import os  # noqa: I001

from crosscheck.cli import (  # noqa: F401 - each adds its commands, in this order
    run, bench, chart, compare, listing, verify, regenerate, export, contract, mutate, invariance, stability, sweep,
    validate, manufacture, sensitivity, label,
)  # fmt: skip
from crosscheck.cli.common import app
from flexmb.output.readers import outlive_readers


def main() -> None:
    """Entry point of the console script."""
    outlive_readers()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices are small: planning takes twice the CPU with threads
    app()
