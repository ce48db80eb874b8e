"""What is compiled is kept: the process after the first one compiles nothing, whatever a scene contains."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from flexmb.jit.installed import unfit
from tests.flexmb.run.every_kind import PARTS

ROOT = Path(__file__).parents[3]


def compiled(*parts: str, **environment: str) -> list[str]:
    """Lines of `every_kind`: kernels that its process compiled, each with whether it is on disk now."""
    command = [sys.executable, "-W", "error::RuntimeWarning", "-m", "tests.flexmb.run.every_kind", *parts]
    inherited = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=ROOT, env=inherited | environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_no_kernel_of_any_kind_of_run_is_lost():
    """Where the suite has run before, none but such kernels are compiled here: they would be, in every process."""
    assert [line for line in compiled("methods") if not line.endswith(": kept")] == []


@pytest.mark.slow
@pytest.mark.parametrize(("kernels", "parts"), [("general", tuple(PARTS)), ("special", ("methods",))])
def test_the_second_process_compiles_nothing(kernels, parts, tmp_path):
    """All cases, every method and algorithm, events, controllers, restarts, closures, linear models, batches.

    Nor does the first one where general kernels came with the installation.
    """
    given = {"NUMBA_CACHE_DIR": str(tmp_path), "FLEXMB_KERNELS": kernels}
    first = compiled(*parts, **given)
    if kernels == "general" and not unfit():
        assert first == []
    else:
        assert len(first) > 50 and all(line.endswith(": kept") for line in first)
    assert compiled(*parts, **given) == []
