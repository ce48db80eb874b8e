"""docs/threads.md: what threads may share, from the calls that a test makes of shared objects. Write it with

    python -m tests.repo.threads
"""

from collections import defaultdict
from collections.abc import Iterable

from tests.flexmb.system.public_calls import LONG, calls
from tests.flexmb.system.shared_calls import THREADS
from tests.flexmb.system.system_calls import REFUSED
from tests.flexmb.system.walk import UNTRIED
from tests.repo.project import ROOT

PAGE = ROOT / "docs" / "threads.md"
INTRODUCTION = f"""# What threads may share

This page is generated from what a test tries: `python -m tests.repo.threads`. {THREADS} threads make each of these
calls at once, on one object or scene, each thread with arguments of its own, and again and again. Their results must
equal those of one thread with objects of its own to the last bit (`tests/flexmb/system/test_threads.py`). The test
finds what must be in the list by following what public calls are given and give (`tests/flexmb/system/walk.py`), and
turns red by the name of a method that is missing. By default two threads make the calls marked \\*; in the slow test
all do.
[Batch](batch.md#threads-in-your-program) says what a thread costs.
"""
FOR_ONE = """## Not shared

| what | why |
|---|---|
| a `State` whose arrays you change in place | other threads read them meanwhile |
| a `SceneBuilder` | its methods change it |
| the array that an evaluator returns | each thread has one of its own, and overwrites it at its next call |
"""

CHAINS = "`System` of a closed chain"


def page() -> str:
    """The text of docs/threads.md."""
    asked = [name for name in calls() if not name.endswith(", attributes")]
    attributes = {f"`{name.split(',')[0]}`" for name in calls() if name.endswith(", attributes")}
    methods, functions = defaultdict[str, set[str]](set), set[str]()
    for name in asked:
        kind, _, method = name.split(",")[0].partition(".")
        kind = CHAINS if name.endswith(", chain") and method else f"`{kind}`"
        if method:
            methods[kind].add(method)
        else:
            functions.add(kind.strip("`"))
    rows = [
        f"| {kind} | {_listed(methods[kind], kind)}{'; all attributes' if kind in attributes else ''} |"
        for kind in sorted({*methods, *attributes}, key=lambda kind: kind.replace("`", ""))
    ]
    untried = [f"| `{name}` | {why} |" for name, why in sorted(UNTRIED.items())]
    parts = [
        INTRODUCTION, "## Shared", "\n".join(["| object | asked by threads at once |", "|---|---|", *rows]),
        f"Functions and constructors, of one scene, system or list: {_listed(functions)}.\n", FOR_ONE, "## Not tried",
        "\n".join(["| call | why |", "|---|---|", *untried]) + "\n",
    ]  # fmt: skip
    return "\n\n".join(part.rstrip("\n") for part in parts) + "\n"


def _listed(names: Iterable[str], kind: str = "") -> str:
    """Marked where few threads ask, or where all are refused."""
    marks = {name: "*" if name in LONG and not kind else "" for name in names}
    marks |= {name: " (refused)" for name in names if kind == CHAINS and name in REFUSED}
    return ", ".join(f"`{name}`{marks[name]}" for name in sorted(marks))


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
