"""Both files of a reference: what may change in them, none beyond the stated uncertainty unless its provenance is
changed as well; and writing both of them, or none.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import msgspec
import numpy as np
import tomlkit
from tomlkit.items import Table

from crosscheck.library.reference import KNOWLEDGE, VALUES, Knowledge, StoredReference
from crosscheck.references.agreement import Agreed
from flexmb.output.files import whole_file, write_whole
from flexmb.run.channels import distance, unit

HEADER = "Written by `crosscheck regenerate`, with reference.csv; nobody edits it. docs/references.md explains it."
NO_WORK = "No table [work]: no run behind these numbers has a motion whose steps an engine counts."


def knowledge_text(knowledge: Knowledge) -> str:
    """The text of reference.toml."""
    document = tomlkit.document()
    document.add(tomlkit.comment(HEADER))
    for key, value in msgspec.to_builtins(knowledge).items():
        if isinstance(value, list | tuple):
            rows = tomlkit.array()
            rows.extend(value)
            document[key] = rows.multiline(True)
        elif key == "work" and value:
            document.update(_work_table(value))
        elif key == "work":
            document.add(tomlkit.comment(NO_WORK))
        else:
            document[key] = value
    return tomlkit.dumps(document)


def _work_table(work: dict[str, dict[str, int]]) -> dict[str, Table]:
    """The table [work], a line for each run."""
    table = tomlkit.table()
    for run, counts in work.items():
        line = tomlkit.inline_table()
        line.update(counts)
        table[run] = line
    return {"work": table}


def write_both(folder: Path, values: str, knowledge: str) -> None:
    """Write both files; if one cannot be written, both remain as they were. OSError names the file.

    They are renamed one right after the other. If the process is killed in between, reading them notices it:
    reference.toml holds the digest of the values that it belongs to.
    """
    texts = {folder / VALUES: values, folder / KNOWLEDGE: knowledge}
    before = {file: file.read_bytes() if file.exists() else None for file in texts}
    try:
        with ExitStack() as together:
            for file, text in texts.items():
                together.enter_context(whole_file(file)).write_bytes(text.encode("utf-8"))
    except BaseException:
        for file, content in before.items():
            if content is None:
                file.unlink(missing_ok=True)
            elif file.read_bytes() != content:
                write_whole(file, content)
        raise


CLOCK = 1e-9  # relative difference of times that are the same
GROWTH = 100.0  # allowed ratio of uncertainties: at other sample times U may be estimated by a weaker rule


def beyond_uncertainty(before: StoredReference, now: Agreed) -> list[str]:
    """How the reference `now` contradicts what `before` had stated; empty if it confirms it.

    A channel that is gone, an earlier horizon, values farther apart than was stated and an uncertainty that has grown
    by more than `GROWTH` are contradictions. More channels, samples and digits are not.
    """
    return list(_changes(before, now))


def largest_share(before: StoredReference, now: Agreed) -> float:
    """The largest change of a channel that both have, relative to the uncertainty that was stated."""
    ours, theirs = _shared(before, now)
    shares = (
        float(np.max(distance(channel, now.channels[channel][ours], before.channels[channel][theirs]), initial=0.0))
        / before.knowledge.channels[channel].uncertainty
        for channel in now.channels
        if channel in before.channels
    )
    return max(shares, default=0.0)


def _changes(before: StoredReference, now: Agreed) -> Iterator[str]:
    if now.times[-1] < before.times[-1] * (1.0 - CLOCK):
        yield f"the horizon is {now.times[-1]:g} s, it was {before.times[-1]:g} s"
    ours, theirs = _shared(before, now)
    if not len(ours):
        yield "none of its times is one of before"
        return
    for channel, rows in before.channels.items():
        stated, symbol = before.knowledge.channels[channel].uncertainty, unit(channel)
        if channel not in now.channels or now.channels[channel].shape[1] != rows.shape[1]:
            yield f"{channel} is not there any more"
            continue
        apart = distance(channel, now.channels[channel][ours], rows[theirs])
        worst = int(np.argmax(apart))
        if not apart[worst] <= stated:
            when = before.times[theirs][worst]
            yield f"{channel} differs by {apart[worst]:.3g} {symbol} at t = {when:.6g} s, stated was {stated:.2g}"
        grown = now.known[channel].uncertainty
        if not grown <= GROWTH * stated:
            yield f"{channel} is known to {grown:.2g} {symbol}, stated in {KNOWLEDGE} was {stated:.2g}"


def _shared(before: StoredReference, now: Agreed) -> tuple[np.ndarray, np.ndarray]:
    """The places of the times that both have, in `now` and in `before`."""
    nearest = np.argmin(np.abs(before.times[None, :] - now.times[:, None]), axis=1)
    same = np.abs(before.times[nearest] - now.times) <= CLOCK * before.times[-1]
    return np.flatnonzero(same), nearest[same]
