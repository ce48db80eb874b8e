"""A witness that is another discretisation: the error of its mesh belongs to what it knows."""

import re
from pathlib import Path

import pytest

pytest.importorskip("exudyn", reason="Exudyn is not installed: pip install flexmb[peers]")

from crosscheck.library.case import CaseError
from crosscheck.library.find import load_case
from crosscheck.library.reference import load_reference
from crosscheck.references.regenerate import regenerate
from crosscheck.running.scheduler import Limits
from flexmb.scene.build import SceneBuilder
from flexmb.scene.files import save_scene
from flexmb.scene.functions import SmoothStep
from flexmb.scene.schema import BeamStation, Modes
from tests.crosscheck.sessions import copy_case, run_here

RUN = """
[[variant]]
name = "exact"
engines = ["native", "native-radau5"]
efforts = [
  { engine = "native", kind = "tolerance", method = "dop853", values = [1e-6, 1e-8, 1e-10] },
  { engine = "native-radau5", kind = "tolerance", method = "radau5", values = [1e-5, 1e-6, 1e-7] },
]

[[variant]]
name = "elements"
REFINED
engines = ["exudyn-beam"]
efforts = [{ engine = "exudyn-beam", kind = "step", method = "GeneralizedAlpha", values = [2e-3, 1e-3, 5e-4] }]

[[comparison]]
name = "two methods"
variant = "exact"
goals = { marker = 1e-5 }

[reference]
variant = "exact"
samples = 11
horizon_s = 1.0
channels = ["marker:tip.position"]

[[reference.route]]
engine = "native"

[[reference.route]]
engine = "native-radau5"

[[reference.route]]
engine = "exudyn-beam"
variant = "elements"
witness = true
"""


@pytest.fixture
def case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A strip of eight cable elements that is pushed, beside one of level exact."""
    monkeypatch.setattr("crosscheck.references.routes.run_planned", run_here)
    folder = copy_case(tmp_path, RUN.replace("REFINED", "refined = { elements = 16 }"))
    section = BeamStation(
        x_m=0.0, EA_N=1e6, EIy_Nm2=2.0, EIz_Nm2=2.0, GJ_Nm2=1.5, mass_per_length_kg_m=0.5, rotary_y_kg_m=1e-6,
        rotary_z_kg_m=1e-6,
    )  # fmt: skip
    push = SmoothStep(start_value=0.0, end_value=5.0, start_s=0.0, duration_s=0.5)
    modes = Modes(count=4, families=("bending_y",))
    scene = (
        SceneBuilder("strip")
        .beam("strip", length=1.0, elements=8, section=section, level="exact", modes=modes)
        .weld("clamp", "ground", "strip")
        .force("push", "strip", node="tip", direction=(0.0, 1.0, 0.0), function=push)
        .marker("tip", "strip", node="tip")
        .scene()
    )
    save_scene(scene, folder / "scene.toml")
    return folder


def made(folder: Path) -> str:
    """What a written reference says of the witness."""
    assert regenerate(load_case(folder), check=False, limits=Limits(workers=1)).done == "written"
    return load_reference(folder).knowledge.channels["marker:tip.position"].how


def test_its_mesh_is_refined_and_what_that_changes_is_in_its_uncertainty(case: Path) -> None:
    said = re.search(r"E (\S+) to exudyn-beam, a witness known to (\S+?)(;|$)", made(case))
    assert said is not None
    assert 1e-5 < float(said[1]) <= float(said[2]) < 2e-2


def test_without_a_finer_mesh_it_is_thought_to_know_better_and_disagrees(case: Path) -> None:
    file = case / "run.toml"
    file.write_text(file.read_text(encoding="utf-8").replace("refined = { elements = 16 }\n", ""), encoding="utf-8")
    with pytest.raises(CaseError, match="exudyn-beam"):
        made(case)
