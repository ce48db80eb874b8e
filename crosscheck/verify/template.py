"""A CSV to fill in."""

from __future__ import annotations

import csv
import io

from crosscheck.library.channels import kind_named
from crosscheck.library.find import Case
from crosscheck.library.reference import current_reference
from crosscheck.running.plan import sample_times, variant_scene
from crosscheck.verify.columns import short_names
from crosscheck.verify.target import chosen_variant, goal_of, has_stored
from flexmb.output.files import as_text
from flexmb.scene.schema import Scene


def sample_times_csv(case: Case, variant: str | None) -> str:
    """The times of the reference and a column for every component of every channel with a goal.

    Without a stored reference of the variant: the case's times, and all markers, hinges and wheels.
    """
    chosen = chosen_variant(case, variant, stored=True)
    if has_stored(case, chosen):
        reference = current_reference(case)
        times = reference.times
        shapes = {name: rows.shape[1] for name, rows in reference.channels.items()}
        shapes = {name: width for name, width in shapes.items() if goal_of(case.run, chosen, name) is not None}
    else:
        times = sample_times(case.run, chosen)
        shapes = _shapes(variant_scene(case.scene(chosen), chosen))
    names = dict.fromkeys(column for channel, width in shapes.items() for column in short_names(channel, width))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["t", *map(as_text, names)])
    writer.writerows([[repr(float(t)), *([""] * len(names))] for t in times])
    return text.getvalue()


def _shapes(scene: Scene) -> dict[str, int]:
    """Channels of the markers, hinges and wheels of a scene, with their widths."""
    items = {
        "marker": [marker.name for marker in scene.markers],
        "load": [hinge.name for hinge in scene.hinges],
        "wheel_load": [wheel.name for wheel in scene.wheels],
    }
    return {
        f"{kind}:{name}.{part.name}": len(part.letters)
        for kind, names in items.items()
        for name in names
        for part in kind_named(kind).parts
    }
