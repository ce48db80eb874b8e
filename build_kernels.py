"""What hatchling runs where a wheel is built, or the checkout installed: it compiles flexmb's general kernels.

They go into flexmb/ready/kernels, of the wheel or of the checkout, so that who runs a scene waits for no compiler: all
of them into a wheel, and into a checkout those that the canonical cases and README's first examples need, half of the
work; the others are compiled when first needed, or by `flexmb warmup --all`. A wheel with kernels is for one version of
Python and one platform; kernels that do not fit where it is installed are compiled there when first needed, as all
special ones are. What is already there and still right is kept.

FLEXMB_BUILD_KERNELS=no leaves them out: the wheel then suits every Python and platform; "first" and "all" are the other
choices. FLEXMB_BUILD_PROCESSOR names the processor that they are for, by LLVM's name, where it is not this one:
"x86-64-v3" for wheels that others install.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

FOLDER = Path("flexmb", "ready", "kernels")
CHOICES = ("first", "all", "no")


class KernelHook(BuildHookInterface):  # type: ignore[type-arg]
    """Fills FOLDER before files are collected."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """version: "standard" or "editable"; the wheel's tag and files are told in `build_data`."""
        choice = os.environ.get("FLEXMB_BUILD_KERNELS") or ("first" if version == "editable" else "all")
        if choice not in CHOICES:
            raise ValueError(f"FLEXMB_BUILD_KERNELS is {choice!r}: use one of {', '.join(CHOICES)}, or leave it unset")
        if choice == "no":
            return
        command = [sys.executable, "-m", "flexmb.ready.make", str(FOLDER), *(["--first"] if choice == "first" else [])]
        if processor := os.environ.get("FLEXMB_BUILD_PROCESSOR"):
            command += ["--processor", processor]
        path = os.pathsep.join(filter(None, (self.root, os.environ.get("PYTHONPATH"))))
        made = subprocess.run(command, cwd=self.root, env=os.environ | {"PYTHONPATH": path}, check=False)
        if made.returncode:
            self.app.display_warning("general kernels could not be compiled: they are when they are first needed")
            return
        build_data["pure_python"], build_data["infer_tag"] = False, True
        build_data["artifacts"].append(f"{FOLDER.as_posix()}/*")
