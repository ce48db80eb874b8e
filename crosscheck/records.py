"""Records: everything a crosscheck run finds out, one JSON object a line, written as it comes.

A file of records is the archive: verdicts and report are made from it alone, with no engine installed. Signals are
stored as float64, deflated and in base64, so that replaying a verdict gives the same digits. A run that was killed
leaves at most one broken line at the end, which reading skips and resuming cuts off.
"""

from __future__ import annotations

import base64
import os
import platform
import zlib
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from crosscheck.accepted import Accepted
from crosscheck.case import Provenance, RunFile
from crosscheck.drawing import Drawing

Array = NDArray[np.float64]
RunStatus = Literal["finished", "diverged", "failed", "crashed", "did not finish", "refused", "did not run"]
PACKAGES = ("flexmb", "numpy", "scipy", "numba", "msgspec", "plotly")


class _Strict(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, tag_field="record"):
    """Base of all records."""


class Environment(_Strict, frozen=True, kw_only=True, tag="environment"):
    """Machine and versions of one session of running, and what was asked for: no engines named means all.

    A session that `confirms` writes a `Confirmed` for each earlier result that it lets stand; older versions did not.
    """

    started: str
    python: str
    system: str
    processor: str
    cores: int
    packages: dict[str, str]
    cases: tuple[str, ...] = ()
    engines: tuple[str, ...] = ()
    confirms: bool = False


class VariantInfo(msgspec.Struct, frozen=True, kw_only=True):
    """What the report needs of a variant's scene: levels of its bodies, how to draw it, or why it could not be made."""

    level: str
    drawing: Drawing | None
    error: str = ""


class CaseRecord(_Strict, frozen=True, kw_only=True, tag="case"):
    """A case as it was run: its run file reduced to the engines asked for, provenance, README, variants, and the
    figures accepted for it."""

    case: str
    run: RunFile
    provenance: Provenance | None
    readme: str
    variants: dict[str, VariantInfo]
    accepted: Accepted = {}


class Packed(msgspec.Struct, frozen=True, kw_only=True):
    """An array of float64: little-endian, row-major, deflated, base64."""

    shape: tuple[int, ...]
    data: str


class RunRecord(_Strict, frozen=True, kw_only=True, tag="run"):
    """One run of one engine at one effort, or why there is none (then `effort` is empty).

    `role` is "main", "refined" or "control:<name>". `rung` counts the efforts of the ladder from coarse to fine out of
    `rungs`. `scene` identifies scene and sample times, `made_by` everything else that the result depends on (see
    `made_by.py`; records of older versions have none). `compile_s` is conversion and warm-up, `wall_s` the solve alone.

    `status`: "finished"; "diverged", as the engine says; "failed" where the adapter raised or broke the contract;
    "crashed" where its process died; "did not finish" within its limits of time and memory; "refused"; "did not run".
    """

    case: str
    variant: str
    role: str
    engine: str
    version: str
    scene: str
    made_by: str = ""
    status: RunStatus
    message: str = ""
    support: str = ""
    effort: str = ""
    effort_kind: str = ""
    effort_method: str = ""
    effort_value: float = 0.0
    rung: int = 0
    rungs: int = 0
    compile_s: float = 0.0
    wall_s: float = 0.0
    evaluations: int = 0
    times: Packed | None = None
    channels: dict[str, Packed] = {}

    @property
    def key(self) -> tuple[str, ...]:
        """What identifies the run: a later record with the same key replaces an earlier one."""
        return (self.case, self.variant, self.role, self.engine, self.effort)


class Confirmed(_Strict, frozen=True, kw_only=True, tag="confirmed"):
    """Says that what earlier sessions recorded under this key is the result of this session too."""

    case: str
    variant: str
    role: str
    engine: str
    scene: str
    made_by: str


Record = Environment | CaseRecord | RunRecord | Confirmed


def pack(values: Array) -> Packed:
    """Array -> text; exact."""
    data = np.ascontiguousarray(values, dtype="<f8")
    return Packed(shape=data.shape, data=base64.b64encode(zlib.compress(data.tobytes(), 6)).decode())


def unpack(packed: Packed) -> Array:
    """Text -> array; exact."""
    data = zlib.decompress(base64.b64decode(packed.data))
    return np.frombuffer(data, dtype="<f8").reshape(packed.shape).astype(np.float64)


def environment(cases: tuple[str, ...] = (), engines: tuple[str, ...] = (), confirms: bool = False) -> Environment:
    """This machine and the versions of what runs on it; what was asked for."""
    return Environment(
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        python=platform.python_version(),
        system=f"{platform.system()} {platform.release()} ({platform.machine()})",
        processor=processor(),
        cores=os.cpu_count() or 1,
        packages={name: _package_version(name) for name in PACKAGES},
        cases=cases,
        engines=engines,
        confirms=confirms,
    )


class Archive:
    """A records file open for appending; every record is on disk when `write` returns."""

    def __init__(self, file: Path) -> None:
        file.parent.mkdir(parents=True, exist_ok=True)
        _cut_broken_end(file)
        self._stream = file.open("ab")
        self._encoder = msgspec.json.Encoder()

    def write(self, record: msgspec.Struct) -> None:
        """Append one line."""
        self._stream.write(self._encoder.encode(record) + b"\n")
        self._stream.flush()

    def close(self) -> None:
        """Close the file."""
        self._stream.close()


def read(file: Path) -> list[Record]:
    """All records of a file, in order; a last line without its end is skipped. ValueError names a wrong line."""
    return decoded_lines(file, Record)


def decoded_lines(file: Path, kind: Any) -> list[Any]:
    """`read` for records of any tagged struct or union of them."""
    decoder = msgspec.json.Decoder(kind)
    found = []
    with file.open("rb") as stream:
        for number, line in enumerate(stream, start=1):
            if not line.endswith(b"\n"):
                break
            try:
                found.append(decoder.decode(line))
            except msgspec.DecodeError as error:
                raise ValueError(f"{file}, line {number}: not a record of this version: {error}") from None
    return found


def _cut_broken_end(file: Path) -> None:
    if not file.exists():
        return
    text = file.read_bytes()
    if not text.endswith(b"\n"):
        file.write_bytes(text[: text.rfind(b"\n") + 1])


def _package_version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def processor() -> str:
    """Model name of the CPU: Linux keeps it in /proc/cpuinfo, elsewhere `platform` knows it."""
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
