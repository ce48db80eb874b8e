"""Trajectories for other libraries: every channel comes back with its name, its unit and all its digits."""

from __future__ import annotations

import csv
import sys

import numpy as np
import pytest

import flexmb as fm
from flexmb.run.trajectory import Trajectory


@pytest.fixture(scope="module")
def trajectory() -> Trajectory:
    """With all kinds of channels: marker, loads, wheel, drive; a name that files and viewers have to quote."""
    scene = (
        fm.SceneBuilder("all, kinds", gravity=(0.1, 0.0, -9.81))
        .rigid_body("arm", mass=1.0, com=(0.5, 0.0, 0.0), inertia=(0.01, 0.1, 0.1))
        .rigid_body("hand/left", mass=0.2, inertia=(0.001, 0.001, 0.001))
        .revolute("pivot", "ground", "arm", axis=(0, 1, 0), angle=0.3)
        .revolute("drive", "arm", "hand/left", parent_position=(1.0, 0.0, 0.0), prescribed=fm.Ramp(rate=2.0))
        .wheel("wheel", "arm", axis=(1, 0, 0), mass=0.1, axial_inertia=1e-3, transverse_inertia=6e-4, speed=50.0)
        .marker('the "end"', "hand/left").scene()
    )  # fmt: skip
    return fm.simulate(scene, t_end=0.5, samples=11, method="dop853", rtol=1e-9, atol=1e-11)


def columns(trajectory: Trajectory) -> dict[str, tuple[str, np.ndarray]]:
    return {name: (unit, values) for name, unit, values in trajectory.columns()}


def test_csv(trajectory, tmp_path):
    trajectory.to_csv(tmp_path / "t.csv")
    with (tmp_path / "t.csv").open(newline="") as stream:
        header, *rows = list(csv.reader(stream))
    for i, (name, (unit, values)) in enumerate(columns(trajectory).items()):
        assert header[i] == f"{name} [{unit}]"
        assert np.array_equal([float(row[i]) for row in rows], values)


def test_numpy_without_unpickling(trajectory, tmp_path):
    trajectory.to_npz(tmp_path / "t.npz")
    with np.load(tmp_path / "t.npz", allow_pickle=False) as found:
        assert str(found["scene"]) == "all, kinds"
        for i, (name, (unit, values)) in enumerate(columns(trajectory).items()):
            assert (found["names"][i], found["units"][i]) == (name, unit)
            assert np.array_equal(found["values"][:, i], values)


def test_pandas(trajectory):
    pytest.importorskip("pandas")
    frame = trajectory.to_pandas()
    wanted = columns(trajectory)
    assert [frame.index.name, *frame.columns] == list(wanted)
    assert np.array_equal(frame.index, trajectory.t)
    for name in frame.columns:
        assert np.array_equal(frame[name], wanted[name][1])
    assert frame.attrs == {"units": {name: unit for name, (unit, _) in wanted.items()}, "scene": "all, kinds"}


def test_parquet(trajectory, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    trajectory.to_parquet(tmp_path / "t.parquet")
    table = parquet.read_table(tmp_path / "t.parquet")
    assert table.schema.metadata[b"scene"] == b"all, kinds"
    for name, (unit, values) in columns(trajectory).items():
        assert table.field(name).metadata == {b"unit": unit.encode()}
        assert np.array_equal(table[name].to_numpy(), values)


def test_xarray(trajectory):
    pytest.importorskip("xarray")
    found = trajectory.to_xarray()
    marker = trajectory.markers['the "end"']
    assert found.sizes["t"] == 11
    assert found["t"].units == "s"
    position = found['marker:the "end".position']
    assert np.array_equal(position.sel(axis="z"), marker.position[:, 2])
    assert position.units == "m"
    assert np.array_equal(found['marker:the "end".orientation'].sel(component="w"), marker.quaternion[:, 0])
    assert np.array_equal(found["load:pivot.torque"], trajectory.loads["pivot"][:, :3])
    assert np.array_equal(found["wheel_load:wheel.force"], trajectory.wheel_loads["wheel"][:, 3:])
    assert np.array_equal(found["drive:drive"].squeeze(), trajectory.drives["drive"][:, 0])
    assert np.array_equal(found["energy.total"], trajectory.total_energy)
    for i, (name, unit) in enumerate(trajectory.q_names):
        assert np.array_equal(found[name], trajectory.q[:, i])
        assert found[name].units == unit


def test_rerun_recordings_are_read_back(trajectory, tmp_path):
    chunks = pytest.importorskip("rerun.chunk")
    trajectory.to_rerun(tmp_path / "t.rrd")
    found = {}
    for chunk in chunks.RrdReader(tmp_path / "t.rrd").stream().to_chunks():
        if not chunk.is_static and chunk.num_rows == 11:
            found[str(chunk.entity_path)] = chunk.to_record_batch().to_pydict()
    marker = trajectory.markers['the "end"']
    (path,) = [each for each in found if each.startswith("/markers/")]
    moved = np.array(found[path]["Transform3D:translation"]).reshape(11, 3)
    turned = np.array(found[path]["Transform3D:quaternion"]).reshape(11, 4)
    assert np.allclose(moved, marker.position, rtol=1e-6, atol=1e-6)  # the viewer has single precision
    assert np.allclose(turned, np.roll(marker.quaternion, -1, axis=1), rtol=1e-6, atol=1e-6)
    force = np.array(found["/curves/load/pivot.force"]["Scalars:scalars"])
    assert np.array_equal(force, trajectory.loads["pivot"][:, 3:])
    assert {"/curves/energy.total", "/curves/work", "/curves/drive/drive"} <= set(found)


METHODS = {"pandas": "to_pandas", "pyarrow": "to_parquet", "xarray": "to_xarray", "rerun": "to_rerun"}


@pytest.mark.parametrize("library", METHODS)
def test_a_missing_library_is_named_with_what_pip_finds(library, trajectory, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, library, None)
    method = getattr(trajectory, METHODS[library])
    with pytest.raises(ImportError, match=f"pip install {library}"):
        method() if library in ("pandas", "xarray") else method(tmp_path / "t")
