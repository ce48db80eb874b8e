"""Distributions of this checkout, and fresh environments to install them in, which fetch nothing."""

import os
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path


def built(target: str, source: Path, folder: Path) -> Path:
    """The file that hatchling makes of a source tree, without kernels, which take minutes."""
    build = [sys.executable, "-m", "hatchling", "build", "--target", target, "--directory", str(folder)]
    without = os.environ | {"FLEXMB_BUILD_KERNELS": "no"}
    subprocess.run(build, cwd=source, check=True, capture_output=True, env=without)
    (archive,) = folder.iterdir()
    return archive


def fresh_environment(home: Path) -> Path:
    """Folder of the commands in an environment that borrows the libraries of this one, and has no flexmb of its own."""
    venv.create(home, with_pip=False, symlinks=True)
    (packages_of(home) / "borrowed.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    return home / ("Scripts" if os.name == "nt" else "bin")


def packages_of(home: Path) -> Path:
    """Where an environment keeps what is installed."""
    return Path(sysconfig.get_path("purelib", "venv", vars={"base": str(home), "platbase": str(home)}))


def install(commands: Path, archive: Path) -> None:
    """Install a wheel, without what it requires."""
    pip = [sys.executable, "-m", "pip", "--python", str(commands / "python"), "install"]
    alone = ["--no-deps", "--no-index", "--no-compile", "--ignore-installed"]
    subprocess.run([*pip, *alone, str(archive)], check=True, capture_output=True)


def installed_apart(source: Path, folder: Path) -> Path:
    """A folder below this one that holds what is installed of a source tree, and nothing else."""
    site = folder / "site"
    pip = [sys.executable, "-m", "pip", "install", "--no-deps", "--no-index", "--target", str(site)]
    subprocess.run([*pip, str(built("wheel", source, folder / "wheel"))], check=True, capture_output=True)
    return site


def called(commands: Path, folder: Path, *words: str, path: Path | None = None) -> subprocess.CompletedProcess[str]:
    """An installed command, run in a folder as a user runs it; `path` stands before what is installed."""
    clean = {name: text for name, text in os.environ.items() if name not in ("PYTHONPATH", "FLEXMB_KERNELS")}
    clean |= {} if path is None else {"PYTHONPATH": str(path)}
    return subprocess.run(
        [str(commands / words[0]), *words[1:]], cwd=folder, env=clean, capture_output=True, text=True, check=False
    )


def said(commands: Path, folder: Path, *words: str, path: Path | None = None) -> str:
    """What a command prints that ends well."""
    run = called(commands, folder, *words, path=path)
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout
