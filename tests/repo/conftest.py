"""What several tests of distributions share: a wheel of this checkout, unpacked, and an environment that has it."""

import zipfile
from pathlib import Path

import pytest

from tests.repo.installations import built, fresh_environment, install
from tests.repo.project import ROOT


@pytest.fixture(scope="session")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel of this checkout."""
    return built("wheel", ROOT, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="session")
def wheel(archive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, unpacked."""
    folder = tmp_path_factory.mktemp("unpacked") / "wheel"
    with zipfile.ZipFile(archive) as packed:
        packed.extractall(folder)
    return folder


@pytest.fixture(scope="session")
def installed(archive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the commands in a fresh environment in which the wheel is installed."""
    commands = fresh_environment(tmp_path_factory.mktemp("fresh"))
    install(commands, archive)
    return commands
