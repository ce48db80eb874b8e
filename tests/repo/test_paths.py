"""No file of the project names a path or a package index of somebody's machine."""

import re

from tests.repo.project import ROOT, text_files

# An absolute path below a home, a scratch or a mount folder, or a package index other than by its public name.
MACHINE = re.compile(
    r"(?<![\w.:/-])/(?:work|root|home|Users|tmp|opt|mnt|data)/[\w.]|[A-Z]:\\\\|index-url|find-links|localhost:\d"
)


def test_no_machine_paths() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in text_files()
        if path.resolve() != ROOT / "tests" / "repo" / "test_paths.py"
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if MACHINE.search(line)
    ]
    assert not found, "\n".join(found)


def test_the_pattern_finds_what_it_looks_for() -> None:
    assert MACHINE.search("open('/home/me/scene.toml')")
    assert not MACHINE.search("https://example.org/home/page")
