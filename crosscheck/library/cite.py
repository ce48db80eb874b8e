"""How a case is cited: one line, made from its title and the sources of its provenance."""

from __future__ import annotations

from crosscheck.library.find import Case
from flexmb.output.versions import version_of

YEAR = 2026  # of this version
AUTHORS = "The flexmb authors"
COLLECTION = "flexmb cases: reference motions of rigid and flexible multibody systems with error bars"
LICENCE, LICENCE_URL = "CC-BY-4.0", "https://creativecommons.org/licenses/by/4.0/"


def cite(case: Case) -> str:
    """The line with which a publication cites the case, and the sources that its data or its reference come from."""
    sources = case.provenance.sources if case.provenance is not None else ()
    version = version_of("flexmb")
    own = f"{AUTHORS} ({YEAR}). {case.run.title} [case {case.name}]. In: {COLLECTION}, version {version}. {LICENCE}."
    return f"{own} After: {'; '.join(' '.join(source.split()) for source in sources)}." if sources else own
