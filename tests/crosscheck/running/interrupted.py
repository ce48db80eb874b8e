"""A session that is interrupted as by Ctrl-C in the middle of a job, and goes on later."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from crosscheck.records.archive import read
from crosscheck.records.kinds import BrokenLine, RunRecord
from tests.crosscheck.sessions import copy_case, versus

MAIN = "from crosscheck.cli import main; main()"
PATIENT = """
import time
from pathlib import Path
from tests.crosscheck.fake_engines import Fake, Pendulum


class Waiting(Pendulum):
    def simulate(self, run, effort):
        while Path({gate!r}).exists():
            time.sleep(0.02)
        return super().simulate(run, effort)


class Patient(Fake):
    def compile(self, scene):
        return Waiting(scene)


def make():
    return Patient("patient")


def fine():
    return Fake("fine")
"""
RUN_FILE = versus("fine", "patient")
EFFORTS = 4  # of each engine


def install_plugs(folder: Path) -> Path:
    """An engine that does its work at once and one that waits while the file `gate`, which is returned, is there."""
    gate = folder / "gate"
    (folder / "patient.py").write_text(PATIENT.format(gate=str(gate)), encoding="utf-8")
    info = folder / "patient_engines-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: patient-engines\nVersion: 1.0\n", encoding="utf-8")
    (info / "entry_points.txt").write_text(
        "[crosscheck.engines]\nfine = patient:fine\npatient = patient:make\n", encoding="utf-8"
    )
    return gate


def interrupt_and_go_on(plugs: Path, gate: Path, folder: Path, *options: str) -> None:
    """Ctrl-C leaves whole records and says so; the next run does the rest, and nothing twice."""
    case, out = copy_case(folder, RUN_FILE), folder / "out"
    command = [sys.executable, "-c", MAIN, "run", str(case), "--out", str(out), "--jobs", "2", *options]
    paths = [str(plugs), str(Path(__file__).parents[3])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    gate.touch()
    first = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True, preexec_fn=_heed_ctrl_c)
    deadline = time.monotonic() + 60.0
    while len(_runs(out)) < EFFORTS and time.monotonic() < deadline:
        time.sleep(0.1)
    first.send_signal(signal.SIGINT)
    said, _ = first.communicate(timeout=30.0)
    assert first.returncode == 130, said
    assert "the same command goes on from there" in said
    assert {record.engine for record in _runs(out)} == {"fine"}
    gate.unlink()
    second = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, timeout=60.0)
    assert second.returncode == 0, second.stdout
    keys = [record.key for record in _runs(out)]
    assert len(keys) == len(set(keys)) == 2 * EFFORTS


def _heed_ctrl_c() -> None:
    """A shell starts what it runs in the background with SIGINT ignored, and children inherit that."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _runs(out: Path) -> list[RunRecord]:
    file = out / "records.jsonl"
    records = read(file) if file.exists() else []
    assert not any(isinstance(record, BrokenLine) for record in records)
    return [record for record in records if isinstance(record, RunRecord)]
