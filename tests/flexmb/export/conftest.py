"""Models that several tests share: to compile one takes long."""

from __future__ import annotations

import pytest

from flexmb.export.model import ExportedModel, model
from tests.flexmb.export.exported_scenes import machine, mechanism


@pytest.fixture(scope="session")
def machine_model() -> ExportedModel:
    return model(machine(), derivatives=True)


@pytest.fixture(scope="session")
def mechanism_model() -> ExportedModel:
    return model(mechanism(), derivatives=True)
