"""What makes a result is in its key: no source that takes part is missed, and no edit is served from the records."""

import importlib
import os
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest

from crosscheck.engines.contract import Effort
from crosscheck.engines.registry import PROVIDER, engine, home
from crosscheck.judging.results import collect
from crosscheck.library.find import load_case, shipped_folder
from crosscheck.records import made_by as keys
from crosscheck.records.archive import read
from crosscheck.records.kinds import Confirmed, Environment, RunRecord
from crosscheck.records.made_by import RECORDING, made_by
from crosscheck.records.session import last_session, standing
from crosscheck.records.sources import sources
from crosscheck.running.execute import execute
from crosscheck.running.plan import plan, scene_identity
from crosscheck.running.scheduler import Limits
from crosscheck.running.sweep import sweep
from tests.crosscheck.sessions import CASE, copy_case

# Loaded in a run of an engine, yet without a part in its numbers.
WITHOUT_PART = {
    "crosscheck.engines.registry": "finds engines and loads them",
    "crosscheck.engines.unusable": "says why an engine cannot be used at all",
    "crosscheck.engines.pinocchio": "another engine, which the registry can load",
    "crosscheck.engines.mujoco": "another engine", "crosscheck.engines.exudyn": "another engine",
    "crosscheck.library": "reads cases and makes scenes, as plan",
    "crosscheck.running.plan": "makes the scene, which is in the record's own key, and holds the stored reference",
    "crosscheck.running.job": "says which efforts are run; the record's own key has scene, sample times, effort, place",
    "crosscheck.running.tuned": "chooses further efforts for charts; their records have a key of their own",
    "crosscheck.records.machine": "tells the reader of a report about the machine", "flexmb.view.draw": "draws",
    "flexmb.view.film": "makes a scene too",
    "crosscheck.engines.functions_of_time": "says to the drawing how a wheel starts; native evaluates functions itself",
    "flexmb.view.drawing": "holds what was drawn",
    "crosscheck.records.kinds": "holds the stored reference, which is made of other runs",
    "crosscheck.pytest_plugin": "finds our modules inside pytest, as Python would",
    "flexmb.output.files": "says what is wrong with a folder",
    "crosscheck.running.scheduler": "says what a scheduler is", "crosscheck.running.worker": "ends processes",
    "crosscheck.records.made_by": "makes the key", "crosscheck.records.sources": "makes the key",
    "flexmb.surrogate": "makes scenes, as plan", "flexmb.scene.check": "refuses scenes, and changes none",
    "flexmb.scene.build": "makes scenes", "flexmb.scene.collecting": "makes scenes",
    "flexmb.scene.methods": "makes scenes",
    "flexmb.scene.files": "reads scenes",
}  # fmt: skip
PLUG_IN = """
from pathlib import Path
from helper import FACTOR
from tests.crosscheck.fake_engines import TOLERANCES, Fake, Pendulum


class Loud(Pendulum):
    def simulate(self, run, effort):
        with Path({diary!r}).open("a") as diary:
            diary.write("x")
        return super().simulate(run, effort)


class Mine(Fake):
    def compile(self, scene):
        return Loud(scene, FACTOR)


def engines():
    return {{"mine": Mine("mine", TOLERANCES[:3])}}
"""
RUN_FILE = '\n[[variant]]\nname = "rigid"\nengines = ["mine"]\n'


class Edited:
    """A plug-in of two modules in a folder, and a case that runs it."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.diary = folder, folder / "diary"
        (folder / "mine.py").write_text(PLUG_IN.format(diary=str(self.diary)), encoding="utf-8")
        self.helper = folder / "helper.py"
        self.helper.write_text("FACTOR = 1.0\n", encoding="utf-8")
        self.case, self.records = copy_case(folder, RUN_FILE), folder / "records.jsonl"

    def runs(self, **options: object) -> int:
        """How many solves another session makes."""
        self.diary.unlink(missing_ok=True)
        sweep([load_case(self.case)], (), self.records, provider="mine:engines", limits=Limits(workers=1), **options)
        return len(self.diary.read_text(encoding="utf-8")) if self.diary.exists() else 0


@pytest.fixture
def edited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Edited:
    monkeypatch.syspath_prepend(tmp_path)
    return Edited(tmp_path)


def test_an_edit_of_a_source_is_run_again_and_its_undoing_is_not_mixed_in(edited: Edited) -> None:
    """The version stays what it was; the edited module is not even the engine's own but one that it imports."""
    all_of_them = edited.runs()
    assert all_of_them >= 5  # three efforts and twice the beginning of the coarsest; where they are short, more
    assert edited.runs() == 0
    edited.helper.write_text("FACTOR = 1.001\n", encoding="utf-8")
    assert edited.runs() >= 5
    (result,) = collect(read(edited.records)).cases[0].results.values()
    assert len(result.runs) == 3
    assert len({run.made_by for run in result.runs}) == 1
    assert edited.runs() == 0


def test_a_ladder_of_two_origins_is_not_one_result(edited: Edited) -> None:
    edited.runs()
    runs = [record for record in read(edited.records) if isinstance(record, RunRecord)]
    others = [record for record in read(edited.records) if not isinstance(record, RunRecord)]
    mixed = [msgspec.structs.replace(runs[0], made_by="another"), *runs[1:]]
    (result,) = collect([*others, *mixed]).cases[0].results.values()
    assert [run.rung for run in result.runs] == [1, 2]


def test_records_of_older_versions_are_read_and_run_again(edited: Edited) -> None:
    first = edited.runs()
    old = [record for record in read(edited.records) if not isinstance(record, Confirmed)]
    text = edited.records.read_text(encoding="utf-8")
    for record in old:
        if isinstance(record, RunRecord):
            text = text.replace(f'"made_by":"{record.made_by}",', "")
    edited.records.write_text(text.replace('"confirms":true', '"confirms":false'), encoding="utf-8")
    (result,) = collect(standing(read(edited.records))).cases[0].results.values()
    assert result.status == "finished"
    assert edited.runs() == first


def test_an_earlier_result_counts_only_where_the_last_session_confirmed_it(edited: Edited) -> None:
    """A session that is cut short after an edit leaves the results of before the edit in the file: they are no news."""
    edited.runs()
    edited.runs()
    found = read(edited.records)
    confirmed = last_session(found)
    assert sum(isinstance(record, RunRecord) for record in confirmed) == 3
    cut_short = [record for record in found if not isinstance(record, Confirmed)]
    for choice in (standing, last_session):
        assert not any(isinstance(record, RunRecord) for record in choice(cut_short))
        session = collect(choice(cut_short))
        assert session.cases[0].get("rigid", "mine").status == "did not run"
    (environment,) = [record for record in confirmed if isinstance(record, Environment)]
    assert environment.cases == ("pendulum/single",)


NATIVE_RUN = """
import sys
import numpy as np
import crosscheck.running.execute
from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.registry import engine
from crosscheck.library.find import load_case
from pathlib import Path
case = load_case(Path(sys.argv[2]))
scene = case.scene(case.run.variants[0])
found = engine(sys.argv[1])
effort = Effort("tolerance", 1e-3, "dop853")
CheckedEngine(found).compile(scene).simulate(Run(np.linspace(0.0, 1e-4, 3)), effort)
print(*(name for name in sys.modules if name.partition(".")[0] in ("flexmb", "crosscheck")))
"""


@pytest.mark.parametrize("name", ["native", "native-frisch"])
def test_every_module_that_a_native_run_loads_is_in_its_key_or_has_no_part(name: str) -> None:
    """In a process of its own, with all that the harness loads to run an engine and to check what it answers."""
    case = shipped_folder() / "free_flying" / "flexible_beam"
    path = os.pathsep.join(each for each in sys.path if each)
    words = [sys.executable, "-c", NATIVE_RUN, name, str(case)]
    answer = subprocess.run(
        words, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=True, timeout=300
    )
    loaded = set(answer.stdout.split())
    covered = sources({"crosscheck.engines.native", home(name)}, RECORDING).files.keys()
    missed = {each for each in loaded - covered if not each.startswith(tuple(WITHOUT_PART))}
    assert not missed
    assert len(loaded & covered) > 60


@pytest.mark.parametrize("name", ["pinocchio", "mujoco", "exudyn"])
def test_every_file_of_ours_that_a_peer_runs_through_is_in_its_key(name: str) -> None:
    """Watched as it runs, until its record is made: a file that the key does not hold is a stale result some day."""
    found = engine(name)
    try:
        found.version()
    except Exception as error:
        pytest.skip(str(error))
    _, jobs = plan(load_case(CASE), (), PROVIDER)
    job = replace(jobs[0], engine=name, times=np.linspace(0.0, 0.01, 3))
    records: list[object] = []
    files = set[str]()
    sys.setprofile(lambda frame, kind, argument: files.add(frame.f_code.co_filename))
    try:
        execute(job, records.append)
    finally:
        sys.setprofile(None)
    assert {record.status for record in records if isinstance(record, RunRecord)} == {"finished"}
    root = Path(keys.__file__).parents[2]
    names = {Path(file).relative_to(root) for file in files if Path(file).is_relative_to(root)}
    modules = {".".join(name.with_suffix("").parts).removesuffix(".__init__") for name in names}
    ours = {module for module in modules if module.partition(".")[0] in ("flexmb", "crosscheck")}
    covered = sources({type(found).__module__, home(name)}, RECORDING).files.keys()
    missed = {each for each in ours - covered if not each.startswith(tuple(WITHOUT_PART))}
    assert not missed
    assert {"crosscheck.engines.answers", "flexmb.run.channels", f"crosscheck.engines.{name}.engine"} <= ours


def test_a_key_holds_libraries_platform_and_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    native = ["crosscheck.engines.native"]
    assert {"numpy", "scipy", "numba", "llvmlite"} <= sources(native).libraries
    assert sources(["crosscheck.engines.pinocchio"]).libraries >= {"pinocchio", "numpy"}
    assert "numba" not in sources(["crosscheck.engines.mujoco"]).libraries

    monkeypatch.setattr(keys, "sources", cache(sources))  # to parse them all takes a second, and nobody edits them

    def key() -> str:
        keys._key.cache_clear()
        keys._machine.cache_clear()
        keys._library.cache_clear()
        return made_by(native)

    first = key()
    assert key() == first
    changes = [
        lambda patch: patch.setenv("NUMBA_OPT", "1"),
        lambda patch: patch.setattr(keys, "processor", lambda: "another"),
        lambda patch: patch.setattr(keys, "_content", lambda library: "another build"),
        lambda patch: patch.setattr(keys, "_text", lambda file: "edited" if file.name == "status.py" else ""),
    ]
    for change in changes:
        with monkeypatch.context() as inner:
            change(inner)
            assert key() != first
    assert key() == first


def test_names_in_strings_and_relative_imports_are_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "plugged"
    package.mkdir()
    texts = {
        "__init__": "from . import fourth", "first": "def f():\n    from .second import x",
        "second": "LATER = 'plugged.third:make'", "third": "import numpy, not_there", "fourth": "", "fifth": "",
    }  # fmt: skip
    for name, text in texts.items():
        (package / f"{name}.py").write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    found = sources(["plugged.first"])
    assert found.files.keys() == {"plugged", "plugged.first", "plugged.second", "plugged.third", "plugged.fourth"}
    assert found.libraries == {"numpy", "not_there"}


def test_efforts_that_differ_in_the_last_digit_have_labels_of_their_own() -> None:
    close = [Effort("step", value, "rk4") for value in (1e-3, 1e-3 * (1 + 2**-52), 0.1 + 0.2, 0.3)]
    assert len({effort.label for effort in close}) == 4
    assert close[0].label == "rk4 h=0.001"


def test_a_changed_file_of_a_scene_changes_its_identity(tmp_path: Path) -> None:
    """The file's bytes count, not only its name."""
    from flexmb.scene.bodies import SidBody
    from flexmb.scene.schema import Scene

    file = tmp_path / "body.sid"
    scene = Scene(name="s", bodies=(SidBody(name="b", file=str(file)),), hinges=())
    file.write_text("one", encoding="utf-8")
    first = scene_identity(scene, np.arange(3.0))
    file.write_text("two", encoding="utf-8")
    assert scene_identity(scene, np.arange(3.0)) != first
