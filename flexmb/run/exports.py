"""Results for other programs: tables of pandas, Parquet, NumPy and CSV, datasets of xarray, recordings of rerun.

These packages are optional, so each is imported where it is used. All formats contain names and units.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flexmb.output.files import whole_file, write_csv
from flexmb.run.channels import channels_of, unit
from flexmb.run.run_arrays import RunArrays
from flexmb.system.section_loads import SectionLoads
from flexmb.typing import Real

if TYPE_CHECKING:
    import pandas
    import xarray

AXES = {3: ("axis", ("x", "y", "z")), 4: ("component", ("w", "x", "y", "z"))}
"""By number of components: name and labels of the last dimension of vectors and quaternions."""


SECTIONS = (
    "t [s]", "x [m]", "axial [N]", "shear_y [N]", "shear_z [N]", "torsion [N m]", "bending_y [N m]", "bending_z [N m]"
)  # fmt: skip
"""Columns of section loads."""


def write_sections(path: Path, t: Real, loads: SectionLoads) -> None:
    """Write section loads as CSV, one row per time t (T,) and section."""
    times, x = np.repeat(t, len(loads.x)), np.tile(loads.x, len(t))
    parts = (loads.axial[..., None], loads.shear, loads.torsion[..., None], loads.bending)
    values = np.concatenate(parts, axis=2).reshape(len(times), -1)
    write_csv(path, SECTIONS, np.column_stack([times, x, values]).tolist())


def write_npz(trajectory: RunArrays, path: Path) -> None:
    """Write `names` (n,), `units` (n,), `values` (T,n) and `scene`: text and numbers only, no pickled objects."""
    names, units, values = zip(*trajectory.columns(), strict=True)
    path = path if path.suffix == ".npz" else path.with_name(f"{path.name}.npz")  # as NumPy names it
    with whole_file(path) as beside, beside.open("wb") as file:
        np.savez(
            file, names=np.array(names), units=np.array(units), values=np.column_stack(values), scene=trajectory.scene
        )


def data_frame(trajectory: RunArrays) -> pandas.DataFrame:
    """A table with one column per channel and time as the index; `attrs` has the units by name, and the scene."""
    with _optional("pandas"):
        import pandas
    columns = list(trajectory.columns())
    frame = pandas.DataFrame(
        {name: values for name, _, values in columns[1:]}, index=pandas.Index(trajectory.t, name="t")
    )
    frame.attrs = {"units": {name: unit for name, unit, _ in columns}, "scene": trajectory.scene}
    return frame


def write_parquet(trajectory: RunArrays, path: Path) -> None:
    """Write one column per channel, its unit in the metadata of its field, the scene in the metadata of the file."""
    with _optional("pyarrow"):
        import pyarrow
        from pyarrow import parquet
    columns = list(trajectory.columns())
    fields = [pyarrow.field(name, pyarrow.float64(), metadata={"unit": unit}) for name, unit, _ in columns]
    about = {"scene": trajectory.scene, "status": json.dumps(trajectory.message)}
    table = pyarrow.table([values for _, _, values in columns], schema=pyarrow.schema(fields, metadata=about))
    with whole_file(path) as beside:
        parquet.write_table(table, beside)


def dataset(trajectory: RunArrays) -> xarray.Dataset:
    """One variable per channel, (t), (t, axis) or, for quaternions, (t, component); units in `attrs` (the convention of
    xarray)."""
    with _optional("xarray"):
        import xarray
    variables: dict[str, Any] = {}
    for name, units, values in _channels(trajectory):
        if name.startswith("drive:"):
            dimension, labels = f"{name}.coordinate", None
        else:
            dimension, labels = AXES.get(values.shape[1], ("", None))
        scalar = labels is None and values.shape[1] == 1
        dims = ("t",) if scalar else ("t", dimension)
        variables[name] = (dims, values[:, 0] if scalar else values, {"units": units})
    coordinates = {name: list(labels) for name, labels in AXES.values()}
    time = ("t", trajectory.t, {"units": "s"})
    return xarray.Dataset(variables, coords={"t": time, **coordinates}, attrs={"scene": trajectory.scene})


def write_recording(trajectory: RunArrays, path: Path) -> None:
    """Write a recording for the viewer rerun: markers are moving frames with paths, all other channels are curves."""
    with _optional("rerun-sdk"):
        import rerun
    with whole_file(path) as beside:
        recording = rerun.RecordingStream("flexmb", recording_id=None)
        recording.save(str(beside), default_blueprint=_blueprint(rerun.blueprint))
        _record(rerun, recording, trajectory)
        recording.flush()
        recording.disconnect()


def _record(rerun: Any, recording: Any, trajectory: RunArrays) -> None:
    """Log markers, their paths and all other channels."""
    time = [rerun.TimeColumn("t", duration=trajectory.t)]
    recording.log("markers", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for name, marker in trajectory.markers.items():
        entity = f"markers/{rerun.escape_entity_path_part(name)}"
        turned = np.roll(marker.quaternion, -1, axis=1)  # rerun expects the scalar last
        recording.send_columns(
            entity, indexes=time, columns=rerun.Transform3D.columns(translation=marker.position, quaternion=turned)
        )
        size = 0.05 * max(float(np.max(np.ptp(marker.position, axis=0), initial=0.0)), 1e-3)
        recording.log(entity, rerun.TransformAxes3D(size), static=True)
        path_of = f"paths/{rerun.escape_entity_path_part(name)}"
        recording.log(path_of, rerun.LineStrips3D([marker.position]), static=True)
    for name, units, values in _channels(trajectory):
        if not name.startswith("marker:"):
            kind, _, rest = name.partition(":")
            parts = [rerun.escape_entity_path_part(part) for part in (kind, rest) if part]
            entity = "/".join(["curves", *parts])
            labels = AXES[3][1] if values.shape[1] == 3 else range(values.shape[1])
            recording.log(
                entity, rerun.SeriesLines(names=[f"{name} {label} [{units}]" for label in labels]), static=True
            )
            columns = rerun.Scalars.columns(scalars=values)
            recording.send_columns(entity, indexes=time, columns=columns)


def _blueprint(blueprint: Any) -> Any:
    """The layout of the viewer: markers and their paths in space; loads, energies and all curves below each other."""
    curves = blueprint.Vertical(
        *(
            blueprint.TimeSeriesView(origin=f"curves/{kind}", name=name)
            for kind, name in (("load", "loads"), ("energy", "energy"))
        ),
        blueprint.TimeSeriesView(origin="curves", name="all curves"),
    )
    return blueprint.Blueprint(blueprint.Horizontal(blueprint.Spatial3DView(origin="/", name="markers"), curves))


def _channels(trajectory: RunArrays) -> Iterator[tuple[str, str, Real]]:
    """(name, unit, values (T,k)) of all coordinates, speeds and channels."""
    for names, values in ((trajectory.q_names, trajectory.q), (trajectory.u_names, trajectory.u)):
        for i, (name, units) in enumerate(names):
            yield name, units, values[:, i : i + 1]
    for name, values in channels_of(trajectory).items():
        yield name, "1" if name.endswith(".orientation") else unit(name), values


@contextmanager
def _optional(package: str) -> Iterator[None]:
    """Imports of an optional package; an ImportError says how to install it."""
    try:
        yield
    except ImportError:
        raise ImportError(f"{package} is not installed: pip install {package}") from None
