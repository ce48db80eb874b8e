"""python -m tests.fuzz --mutants 50000: read so many mutated files; bad ones are kept in --keep. 0 if there is none.

--replay KIND FILE reads one of them again and says what comes of it.
"""

import argparse
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path

from tests.fuzz.campaign import campaign, table
from tests.fuzz.kinds import kinds
from tests.fuzz.worker import BAD, read


def main() -> int:
    """Read the words, run, print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--only", default="", help="one kind of file")
    parser.add_argument("--keep", type=Path, default=Path("out/fuzz"))
    parser.add_argument("--replay", nargs=2, metavar=("KIND", "FILE"))
    words = parser.parse_args()
    if words.replay:
        with tempfile.TemporaryDirectory() as folder:
            kind = kinds(Path(folder))[words.replay[0]]
            path = Path(folder) / kind.file
            shutil.copyfile(words.replay[1], path)
            print(*read(kind, path), sep=": ")
        return 0
    start = time.perf_counter()
    results = campaign(words.mutants, words.seed, words.workers, words.keep.resolve(), words.only)
    bad = [result for result in results if result["outcome"] in BAD]
    print(table(results))
    print(f"{len(results)} mutants in {time.perf_counter() - start:.0f} s, {len(bad)} bad, kept in {words.keep}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
