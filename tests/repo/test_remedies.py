"""What a message tells to install, pip finds: the libraries themselves, not extras of a package that no index has."""

import re
import tomllib
from collections.abc import Iterator

from tests.repo.project import ROOT

ASKED = re.compile(r"""pip install (?:--?[\w-]+ )*["']*([A-Za-z][\w.-]*(?:\[[\w,-]+\])?)""")
DISTRIBUTION = re.compile(r"[A-Za-z][\w.-]*(?:\[[\w,-]+\])?")
NOT_OURS = {"control"}  # python-control, to whose objects a linear model can be given


def remedies() -> Iterator[tuple[str, str]]:
    """File and distribution of every remedy in the sources that is written out."""
    for package in ("flexmb", "crosscheck"):
        for file in sorted((ROOT / package).rglob("*.py")):
            for name in ASKED.findall(file.read_text(encoding="utf-8")):
                yield str(file.relative_to(ROOT)), name


def optional() -> set[str]:
    """The distributions of the optional dependencies, other than this project's own extras."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    names = {DISTRIBUTION.match(text)[0] for group in extras.values() for text in group}  # type: ignore[index]
    return {name for name in names if not name.startswith("flexmb")}


def test_remedies_name_distributions_that_pip_finds() -> None:
    known, found = optional() | NOT_OURS, list(remedies())
    assert len(found) >= 8
    assert [(file, name) for file, name in found if name not in known] == []


def test_extras_of_this_project_are_no_remedy() -> None:
    assert ASKED.findall("JAX is missing: pip install 'flexmb[jax]'") == ["flexmb[jax]"]
    assert "flexmb[jax]" not in optional() and "dask[distributed]" in optional()
