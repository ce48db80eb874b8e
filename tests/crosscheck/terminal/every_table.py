"""Runs commands of both command lines one after the other: `python every_table.py FILE`, words of commands in JSON."""

import json
import sys
from pathlib import Path

import crosscheck.cli
import flexmb.cli

PROGRAMS = {"crosscheck": crosscheck.cli.app, "flexmb": flexmb.cli.app}

if __name__ == "__main__":
    for program, *words in json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")):
        print("###", program, words[0], flush=True)
        try:
            PROGRAMS[program](words)
        except SystemExit as end:
            print("### ends with", end.code, flush=True)
